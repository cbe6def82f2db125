#pragma once

#include <charconv>
#include <string>
#include <string_view>
#include <type_traits>

#include "cairn/base/file.h"

namespace cairn {

// Appends text and numbers to a file that appears on Commit. Floating-point numbers are the
// shortest text that reads back as the same number, whatever the locale.
class TextWriter {
 public:
  explicit TextWriter(const std::string& path) : file_(path) {}

  TextWriter& operator<<(std::string_view text) {
    buffer_ += text;
    if (buffer_.size() > kBlockSize) Flush();
    return *this;
  }
  template <class T>
  requires std::is_arithmetic_v<T> TextWriter& operator<<(T value) {
    char digits[32];
    return *this << std::string_view(
               digits, std::to_chars(digits, digits + sizeof(digits), value).ptr - digits);
  }
  // Values with a blank between them, from any Eigen vector or row, in order.
  template <class Vector>
  TextWriter& Row(const Vector& values) {
    for (int i = 0; i < static_cast<int>(values.size()); ++i) {
      if (i > 0) *this << " ";
      *this << values[i];
    }
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
