#pragma once

#include <ceres/cost_function.h>

#include "bundle_adjustment/bundle_state.h"

namespace cairn {

// Reprojection error of one observation, in its standard deviations, and its derivatives by what is
// free, in this order: point (3), pose (omega and center, 6, or one of them, 3), intrinsics. The
// state must be up to date (BundleState).
struct Reprojection {
  struct Free {
    bool point = true;
    bool rotation = true;
    bool position = true;
  };

  const PoseState* pose;
  const Eigen::Vector3d* point;
  Eigen::Vector2d pixel;
  double precision;  // 1 / sigma_px
  Free free;

  // As ceres::CostFunction. False: the point lies where its camera sees nothing.
  bool Evaluate(double* residuals, double** jacobians) const;

 private:
  template <int kCols>
  using RowMajor2 = Eigen::Matrix<double, 2, kCols, Eigen::RowMajor>;

  // From d(residual)/d(x_cam) and d(pixel)/d(params), 2 x num_params.
  void FillJacobians(const Eigen::Vector3d& x, const RowMajor2<3>& J_camera, const double* J_params,
                     double** jacobians) const;
};

// For Ceres.
class ReprojectionCost : public ceres::CostFunction {
 public:
  explicit ReprojectionCost(const Reprojection& reprojection);

  bool Evaluate(const double* const* /* in the state */, double* residuals,
                double** jacobians) const override {
    return reprojection_.Evaluate(residuals, jacobians);
  }

 private:
  Reprojection reprojection_;
};

}  // namespace cairn
