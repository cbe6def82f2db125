#pragma once

#include <Eigen/Core>

namespace cairn {

// The two rotations and the direction of an essential matrix E ~ [t]x R: the four poses are
// (R1, t), (R1, -t), (R2, t), (R2, -t). Closed form (Horn, "Recovering baseline and orientation
// from essential matrix", 1990), so no SVD; E must satisfy the constraints of an essential matrix.
struct EssentialDecomposition {
  Eigen::Matrix3d R1;
  Eigen::Matrix3d R2;
  Eigen::Vector3d t;  // |t| = 1
};
EssentialDecomposition DecomposeEssential(const Eigen::Matrix3d& E);

// The essential matrix nearest to a 3x3 matrix in Frobenius norm, scaled to singular values
// (1, 1, 0).
Eigen::Matrix3d NearestEssential(const Eigen::Matrix3d& matrix);

}  // namespace cairn
