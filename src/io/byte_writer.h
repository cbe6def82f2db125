#pragma once

#include <cstring>
#include <string_view>
#include <type_traits>

#include "io/block_writer.h"

namespace cairn {

// Appends little-endian binary data to a file that appears on Commit.
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
