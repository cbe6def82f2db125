#pragma once

#include <Eigen/Core>

#include "cairn/solvers/affine_frame.h"

namespace cairn {

// Essential matrix from two affine correspondences without depth: Barath and Hajder, "Efficient
// recovery of essential matrix from two affine correspondences", TIP 2018. Each gives three linear
// equations (its point, and its derivative along the two axes of the frame).
struct TwoAffine {
  static constexpr int kSampleSize = 2;
  static constexpr int kMaxSolutions = 1;
  using Sample = AffineCorrespondence;
  using Model = Eigen::Matrix3d;
  // The six equations leave three dimensions; within them the ten cubic constraints are solved as a
  // linear system in the monomials of the two unknowns. Exact for exact data; |E| = sqrt(2).
  static int Solve(const Sample* samples, Model* models);
};

// The same equations, but the four-dimensional space that fulfills them best goes to the five-point
// solver: up to ten solutions, each an exact essential matrix, and less sensitive to errors of the
// frames' shapes.
struct TwoAffineFivePoint {
  static constexpr int kSampleSize = 2;
  static constexpr int kMaxSolutions = 10;
  using Sample = AffineCorrespondence;
  using Model = Eigen::Matrix3d;
  static int Solve(const Sample* samples, Model* models);
};

}  // namespace cairn
