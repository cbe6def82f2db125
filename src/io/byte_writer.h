#pragma once

#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>

#include "cairn/base/file.h"

namespace cairn {

// Appends little-endian binary data to a file that appears on Commit.
class ByteWriter {
 public:
  explicit ByteWriter(const std::string& path) : file_(path) {}

  template <class T>
  requires std::is_arithmetic_v<T> ByteWriter& operator<<(T value) {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    return *this << std::string_view(bytes, sizeof(T));
  }
  ByteWriter& operator<<(std::string_view bytes) {
    buffer_ += bytes;
    if (buffer_.size() > kBlockSize) Flush();
    return *this;
  }
  void Commit() {
    Flush();
    file_.Commit();
  }
  // Writes what is buffered, so that Commit needs no space.
  void Flush() {
    file_.Write(buffer_);
    buffer_.clear();
  }

 private:
  static constexpr size_t kBlockSize = 1 << 20;
  AtomicFile file_;
  std::string buffer_;
};

}  // namespace cairn
