#pragma once

#include <ceres/cost_function.h>

#include "bundle_adjustment/bundle_state.h"

namespace cairn {

// Reprojection error of one observation, in its standard deviations. Its parameter blocks are those
// that are free, in this order: point (3), pose (omega and center, 6, or one of them, 3),
// intrinsics.
class ReprojectionCost : public ceres::CostFunction {
 public:
  struct Free {
    bool point = true;
    bool rotation = true;
    bool position = true;
  };

  ReprojectionCost(const PoseState* pose, const Eigen::Vector3d* point,
                   const Eigen::Vector2d& pixel, double sigma_px, const Free& free);

  bool Evaluate(const double* const* parameters, double* residuals,
                double** jacobians) const override;

 private:
  template <int kCols>
  using RowMajor2 = Eigen::Matrix<double, 2, kCols, Eigen::RowMajor>;

  // Of a camera that is not planar; x is the point in its frame.
  bool EvaluateWide(const Eigen::Vector3d& x, double* residuals, double** jacobians) const;
  // From d(residual)/d(x_cam) and d(pixel)/d(params), 2 x num_params.
  void FillJacobians(const Eigen::Vector3d& x, const RowMajor2<3>& J_camera, const double* J_params,
                     double** jacobians) const;

  const PoseState* pose_;
  const Eigen::Vector3d* point_;
  Eigen::Vector2d pixel_;
  double precision_;  // 1 / sigma_px
  Free free_;
};

}  // namespace cairn
