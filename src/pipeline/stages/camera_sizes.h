#pragma once

#include <map>

#include "cairn/database/database.h"
#include "cairn/image/bitmap.h"

namespace cairn {

// The size of the photographs of each camera, those of unknown models included.
inline std::map<camera_t, ImageSize> CameraSizes(const Database& database) {
  std::map<camera_t, ImageSize> sizes;
  for (const Camera& camera : database.ReadCameras()) {
    sizes[camera.camera_id] = {camera.width, camera.height};
  }
  for (const UnknownCamera& camera : database.ReadUnknownCameras()) {
    sizes[camera.camera_id] = {camera.width, camera.height};
  }
  return sizes;
}

}  // namespace cairn
