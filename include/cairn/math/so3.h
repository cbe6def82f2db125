#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cairn {

// [v]x, so that CrossMatrix(v) * w = v x w.
Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v);

// Exponential and logarithm of SO(3): axis times angle (radians) and rotation. Both are accurate
// near zero; Log returns an angle in [0, pi].
Eigen::Quaterniond ExpSO3(const Eigen::Vector3d& axis_angle);
Eigen::Vector3d LogSO3(const Eigen::Quaterniond& rotation);

// The rotation nearest to a 3x3 matrix in Frobenius norm (SVD).
Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix);

}  // namespace cairn
