#pragma once

#include <Eigen/Core>
#include <span>

#include "cairn/solvers/point_correspondence.h"

namespace cairn::internal {

// Hartley's normalization: x -> scale (x - center), to centroid zero and mean distance sqrt(2).
struct PointNormalization {
  Eigen::Vector2d center = Eigen::Vector2d::Zero();
  double scale = 1.0;

  Eigen::Vector2d Apply(const Eigen::Vector2d& x) const { return scale * (x - center); }
  Eigen::Matrix3d Matrix() const;
};

// Over one side of the correspondences. False if all points coincide.
bool NormalizePoints(std::span<const PointCorrespondence> samples,
                     Eigen::Vector2d PointCorrespondence::*side, PointNormalization* normalization);

}  // namespace cairn::internal
