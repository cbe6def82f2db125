#pragma once

#include <Eigen/Core>

#include "cairn/solvers/point_correspondence.h"

namespace cairn {

// Fundamental matrices from seven correspondences (Hartley and Zisserman, 11.1.2): the roots of
// det(a F1 + (1 - a) F2) = 0. Points in any units of size about one. |F| = 1.
struct SevenPoint {
  static constexpr int kSampleSize = 7;
  static constexpr int kMaxSolutions = 3;
  using Sample = PointCorrespondence;
  using Model = Eigen::Matrix3d;
  static int Solve(const Sample* samples, Model* models);
};

}  // namespace cairn
