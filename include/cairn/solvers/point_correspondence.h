#pragma once

#include <Eigen/Core>

namespace cairn {

// Two image points that show the same scene point: normalized (rays with third component 1) unless
// a solver says otherwise.
struct PointCorrespondence {
  Eigen::Vector2d x1 = Eigen::Vector2d::Zero();
  Eigen::Vector2d x2 = Eigen::Vector2d::Zero();
};

}  // namespace cairn
