#pragma once

#include <Eigen/Core>

namespace cairn {

// Between Bundler's camera frame (x right, y up, z backward) and ours (x right, y down, z forward);
// its own inverse.
inline Eigen::Matrix3d FlipYZ() { return Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal(); }

}  // namespace cairn
