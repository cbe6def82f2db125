#pragma once

#include <string>

#include "cairn/camera/camera.h"
#include "database/query.h"

namespace cairn {

// A row of `cameras`.
struct CameraRow {
  Camera camera;
  bool is_known_model = true;
  std::string bad;  // why it cannot be used; "": it can
};
CameraRow ReadCameraRow(const Query& query);

// Why the row of an image cannot be used; "": it can.
std::string ReasonAgainstImage(int64_t image_id, const std::string& name, int64_t camera_id);

// "matches of pair 6442450943 (images 3, 2)".
std::string PairRowName(const char* table, int64_t pair_id);

}  // namespace cairn
