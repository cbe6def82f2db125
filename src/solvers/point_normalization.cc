#include "solvers/point_normalization.h"

#include <numbers>

namespace cairn::internal {

Eigen::Matrix3d PointNormalization::Matrix() const {
  Eigen::Matrix3d T;
  T << scale, 0.0, -scale * center.x(), 0.0, scale, -scale * center.y(), 0.0, 0.0, 1.0;
  return T;
}

bool NormalizePoints(std::span<const PointCorrespondence> samples,
                     Eigen::Vector2d PointCorrespondence::*side,
                     PointNormalization* normalization) {
  normalization->center.setZero();
  for (const PointCorrespondence& sample : samples) normalization->center += sample.*side;
  normalization->center /= static_cast<double>(samples.size());
  double sum = 0.0;
  for (const PointCorrespondence& sample : samples) {
    sum += (sample.*side - normalization->center).norm();
  }
  if (!(sum > 0.0)) return false;
  normalization->scale = std::numbers::sqrt2 * static_cast<double>(samples.size()) / sum;
  return true;
}

}  // namespace cairn::internal
