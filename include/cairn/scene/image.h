#pragma once

#include <string>

#include "cairn/base/types.h"

namespace cairn {

// A photograph: its name is the path relative to the image folder.
struct Image {
  image_t image_id = kInvalidImageId;
  std::string name;
  camera_t camera_id = kInvalidCameraId;
};

}  // namespace cairn
