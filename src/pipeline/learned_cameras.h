#pragma once

#include <vector>

#include "cairn/camera/camera.h"
#include "cairn/database/database.h"

namespace cairn {

// The camera with the focal length and the distortion that were learned.
void ApplyLens(const CameraLens& lens, Camera* camera);

// The database's cameras, each with what verification learned of it. has_prior_focal_length is the
// database's.
std::vector<Camera> ReadLearnedCameras(const Database& database);

}  // namespace cairn
