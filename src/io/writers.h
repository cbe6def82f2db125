#pragma once

#include <charconv>
#include <cstring>
#include <initializer_list>
#include <string>
#include <string_view>
#include <type_traits>

#include "cairn/base/file.h"

namespace cairn {

// Appends bytes, in blocks, to a file that appears on Commit.
class BlockWriter {
 public:
  explicit BlockWriter(const std::string& path) : file_(path) {}

  void Append(std::string_view bytes) {
    buffer_ += bytes;
    if (buffer_.size() > kBlockSize) Flush();
  }
  void Commit() {
    Flush();
    file_.Commit();
  }
  // None appears before all are written, when Commit needs no more space.
  static void CommitAll(std::initializer_list<BlockWriter*> files) {
    for (BlockWriter* file : files) file->Flush();
    for (BlockWriter* file : files) file->Commit();
  }

 private:
  void Flush() {
    file_.Write(buffer_);
    buffer_.clear();
  }

  static constexpr size_t kBlockSize = 1 << 20;
  AtomicFile file_;
  std::string buffer_;
};

// Text and numbers. Floating-point numbers are the shortest text that reads back as the same
// number, whatever the locale.
class TextWriter : public BlockWriter {
 public:
  using BlockWriter::BlockWriter;

  TextWriter& operator<<(std::string_view text) {
    Append(text);
    return *this;
  }
  template <class T>
  requires std::is_arithmetic_v<T> TextWriter& operator<<(T value) {
    char digits[32];
    return *this << std::string_view(
               digits, std::to_chars(digits, digits + sizeof(digits), value).ptr - digits);
  }
  // The numbers of any vector, array, or row of a matrix, with a blank between them.
  template <class Values>
  requires(!std::is_convertible_v<const Values&, std::string_view>) &&
      requires(const Values& values) {
    values.size();
  }
  TextWriter& operator<<(const Values& values) {
    for (int i = 0; i < static_cast<int>(values.size()); ++i) {
      if (i > 0) *this << " ";
      *this << values[i];
    }
    return *this;
  }
};

// Little-endian binary data.
class ByteWriter : public BlockWriter {
 public:
  using BlockWriter::BlockWriter;

  ByteWriter& operator<<(std::string_view bytes) {
    Append(bytes);
    return *this;
  }
  template <class T>
  requires std::is_arithmetic_v<T> ByteWriter& operator<<(T value) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    return *this << std::string_view(bytes, sizeof(T));
  }
};

}  // namespace cairn
