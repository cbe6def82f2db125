#pragma once

#include <Eigen/Core>

#include "cairn/solvers/point_correspondence.h"

namespace cairn {

// Essential matrices from five correspondences of normalized points: Nister, "An efficient solution
// to the five-point relative pose problem", PAMI 2004, with a last Gauss-Newton polish on the
// constraints of Stewenius et al., 2006. Up to ten solutions with x2^T E x1 = 0, |E| = sqrt(2).
struct FivePoint {
  static constexpr int kSampleSize = 5;
  static constexpr int kMaxSolutions = 10;
  using Sample = PointCorrespondence;
  using Model = Eigen::Matrix3d;
  static int Solve(const Sample* samples, Model* models);
};

// The same from any four-dimensional space of candidates E = x X + y Y + z Z + W, given as the
// columns X, Y, Z, W of `basis` (each a 3x3 matrix, row-major).
int SolveEssentialInSpace(const Eigen::Matrix<double, 9, 4>& basis, Eigen::Matrix3d* models);

}  // namespace cairn
