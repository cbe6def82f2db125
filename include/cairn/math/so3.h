#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>

namespace cairn {

// [v]x, so that CrossMatrix(v) * w = v x w.
Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v);

// Exponential and logarithm of SO(3): axis times angle (radians) and rotation. Both are accurate
// near zero; Log returns an angle in [0, pi].
Eigen::Quaterniond ExpSO3(const Eigen::Vector3d& axis_angle);
Eigen::Vector3d LogSO3(const Eigen::Quaterniond& rotation);

// The rotation nearest to a 3x3 matrix in Frobenius norm (SVD).
Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix);

// The rotation that a matrix of a few digits means, as of a file: as it is where it is exact, else
// the nearest one; nullopt if it is none up to `max_defect` of R R^T.
std::optional<Eigen::Quaterniond> ToRotation(const Eigen::Matrix3d& R, double max_defect = 1e-2);

}  // namespace cairn
