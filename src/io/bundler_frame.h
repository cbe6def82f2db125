#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

#include "cairn/math/so3.h"

namespace cairn {

// Between Bundler's camera frame (x right, y up, z backward) and ours (x right, y down, z forward);
// its own inverse.
inline Eigen::Matrix3d FlipYZ() { return Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal(); }

// The rotation that a matrix read from a file means: as it is where it is exact, else the nearest
// one; nullopt if it is none up to the file's rounding.
inline std::optional<Eigen::Quaterniond> ToRotation(const Eigen::Matrix3d& R) {
  constexpr double kExact = 1e-13, kRounded = 1e-2;
  const double error = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error < kRounded) || !(R.row(0).cross(R.row(1)).dot(R.row(2)) > 0)) return std::nullopt;
  return Eigen::Quaterniond(error < kExact ? R : NearestRotation(R)).normalized();
}

}  // namespace cairn
