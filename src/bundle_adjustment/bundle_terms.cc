#include "bundle_adjustment/bundle_terms.h"

#include <cmath>
#include <vector>

#include "cairn/base/check.h"

namespace cairn {
namespace {

// Distortion of ordinary lenses at an image's corner, relative to its radius: data sheets of zoom
// lenses state 1 % to 5 %.
constexpr double kLensDistortion = 0.03;

// Standard deviation of the logarithm of fx / fy: the calibrated cameras of ../shared/data have
// square pixels within 0.5 %, and sizes of images are rounded.
constexpr double kPixelShape = 0.01;

// 1 / standard deviation of a distortion coefficient, as AdjustBundle says.
double DistortionPrecision(const Camera& camera, int index) {
  Eigen::Vector2d corner(0.5 * camera.width / camera.FocalX(),
                         0.5 * camera.height / camera.FocalY());
  std::vector<double> J(2 * camera.params.size());
  Eigen::Matrix2d J_uv;
  // (Nearer to the center where the corner without distortion is beyond the model's field.)
  for (; corner.norm() > 1e-3; corner *= 0.5) {
    if (camera.ImgFromCam(corner, &J_uv, J.data()).allFinite()) break;
  }
  const double r = corner.norm();
  const double share = std::hypot(kLensDistortion, 1.0 - std::atan(r) / r);
  return std::hypot(J[index], J[camera.params.size() + index]) / (share * r * camera.MeanFocal());
}

}  // namespace

std::unique_ptr<ceres::LossFunction> MakeLoss(const BundleAdjustmentOptions& options) {
  switch (options.loss) {
    case ReprojectionLoss::kNone:
      return nullptr;
    case ReprojectionLoss::kSoftL1:
      return std::make_unique<ceres::SoftLOneLoss>(options.loss_scale);
    case ReprojectionLoss::kHuber:
      return std::make_unique<ceres::HuberLoss>(options.loss_scale);
    case ReprojectionLoss::kCauchy:
      return std::make_unique<ceres::CauchyLoss>(options.loss_scale);
  }
  return nullptr;
}

FreeIntrinsicsPrior PriorOfFree(const Camera& camera, const IntrinsicsPrior& prior,
                                const IntrinsicsState& state) {
  CAIRN_CHECK_EQ(prior.params.size(), camera.params.size());
  FreeIntrinsicsPrior result{Eigen::VectorXd(state.num_free), Eigen::VectorXd(state.num_free)};
  const auto log_factor = [&](int i) {
    return std::log(prior.params[state.free_index[i]] / state.initial[state.free_index[i]]);
  };
  if (state.num_free_focal > 0) {
    result.mean[0] = log_factor(0);
    result.precision[0] = 1.0 / prior.focal_sigma;
  }
  if (state.num_free_focal == 2) {
    result.mean[0] = 0.5 * (log_factor(0) + log_factor(1));
    result.mean[1] = log_factor(0) - log_factor(1);
    result.precision[1] = 1.0 / kPixelShape;
  }
  for (int i = state.num_free_focal; i < state.num_free; ++i) {
    const int k = state.free_index[i];
    result.mean[i] = prior.params[k];
    result.precision[i] = i >= state.first_principal_point ? 1.0 / prior.principal_point_sigma_px
                                                           : DistortionPrecision(camera, k);
  }
  return result;
}

Tempo TempoOf(const BundleAdjustmentOptions& options, const BundleAdjustmentScope& scope,
              int64_t num_observations) {
  const auto num_positions =
      static_cast<double>(scope.image_positions.size() + scope.surveyed_points.size());
  Tempo tempo{.tolerance = options.function_tolerance};
  // Rotations nearly undo what principal points do: the initial damping would be stiffer than what
  // is left.
  if (scope.principal_points) tempo.initial_damping = 1e-6;
  if (num_positions > 0) {
    // Positions hold the world frame, and the initial damping would be stiffer than they are. What
    // they still bring is small beside the cost of all observations.
    tempo.initial_damping = kMinDamping;
    tempo.tolerance *= num_positions / (num_positions + static_cast<double>(num_observations));
  }
  return tempo;
}

void SetRmse(double initial_cost, double final_cost, BundleAdjustmentReport& report) {
  const auto rmse = [&](double cost) {
    return std::sqrt(cost / static_cast<double>(report.num_observations));
  };
  report.initial_rmse = rmse(initial_cost);
  report.final_rmse = rmse(final_cost);
}

}  // namespace cairn
