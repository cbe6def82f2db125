#pragma once

#include <charconv>
#include <string_view>
#include <type_traits>

#include "io/block_writer.h"

namespace cairn {

// Appends text and numbers to a file that appears on Commit. Floating-point numbers are the
// shortest text that reads back as the same number, whatever the locale.
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
  // Values with a blank between them, from any Eigen vector or row, in order.
  template <class Vector>
  TextWriter& Row(const Vector& values) {
    for (int i = 0; i < static_cast<int>(values.size()); ++i) {
      if (i > 0) *this << " ";
      *this << values[i];
    }
    return *this;
  }
};

}  // namespace cairn
