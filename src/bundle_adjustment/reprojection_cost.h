#pragma once

#include <ceres/cost_function.h>

#include "bundle_adjustment/bundle_state.h"

namespace cairn {

// Reprojection error (pixels) of one observation. Its parameter blocks are those that are free, in
// this order: point (3), pose (omega and center, 6, or one of them, 3), intrinsics.
class ReprojectionCost : public ceres::CostFunction {
 public:
  struct Free {
    bool point = true;
    bool rotation = true;
    bool position = true;
  };

  ReprojectionCost(const PoseState* pose, const Eigen::Vector3d* point,
                   const Eigen::Vector2d& pixel, const Free& free);

  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  const PoseState* pose_;
  const Eigen::Vector3d* point_;
  Eigen::Vector2d pixel_;
  Free free_;
};

}  // namespace cairn
