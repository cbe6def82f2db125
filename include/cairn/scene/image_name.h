#pragma once

#include <string_view>

namespace cairn {

// Names with a line break or a zero byte cannot be written to any model.
inline bool IsImageName(std::string_view name) {
  return !name.empty() && name.find_first_of(std::string_view("\0\n\r", 3)) == name.npos;
}

}  // namespace cairn
