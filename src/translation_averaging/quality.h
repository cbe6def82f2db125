#pragma once

#include <Eigen/Core>
#include <vector>

namespace cairn {

// How camera centers are spread, from their distances to the (componentwise) median.
struct SpreadReport {
  // The distance within which half of the cameras lie, over that within which 90 % do: tiny when
  // the solution has folded into a point and a few far cameras.
  double half_over_most = 1;
  // Cameras so far out that they can only have been thrown there.
  std::vector<int> thrown_away;
};
SpreadReport AnalyzeSpread(const Eigen::Matrix3Xd& centers, double min_spread);

}  // namespace cairn
