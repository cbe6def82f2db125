#pragma once

#include <string>
#include <string_view>

#include "cairn/base/types.h"

namespace cairn {

// A photograph: its name is the path relative to the image folder.
struct Image {
  image_t image_id = kInvalidImageId;
  std::string name;
  camera_t camera_id = kInvalidCameraId;
};

// Names with a line break or a zero byte cannot be written to any model.
inline bool IsImageName(std::string_view name) {
  return !name.empty() && name.find_first_of(std::string_view("\0\n\r", 3)) == name.npos;
}

}  // namespace cairn
