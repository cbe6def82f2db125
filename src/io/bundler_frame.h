#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cairn/math/so3.h"

namespace cairn {

// Between Bundler's camera frame (x right, y up, z backward) and ours (x right, y down, z forward);
// its own inverse.
inline Eigen::Matrix3d FlipYZ() { return Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal(); }

// Whether a matrix read from a file is a rotation up to the file's rounding.
inline bool IsNearRotation(const Eigen::Matrix3d& R) {
  constexpr double kTolerance = 1e-2;
  return (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < kTolerance &&
         R.row(0).cross(R.row(1)).dot(R.row(2)) > 0;
}

// The rotation that such a matrix means: as it is where it is exact, else the nearest one.
inline Eigen::Quaterniond ToRotation(const Eigen::Matrix3d& R) {
  const double error = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  return Eigen::Quaterniond(error < 1e-13 ? R : NearestRotation(R)).normalized();
}

}  // namespace cairn
