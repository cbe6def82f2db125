#include "bundle_adjustment/bundle_terms.h"

#include <cmath>

namespace cairn {

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

Tempo TempoOf(const BundleAdjustmentOptions& options, const BundleAdjustmentScope& scope,
              int64_t num_observations) {
  const auto num_positions =
      static_cast<double>(scope.image_positions.size() + scope.surveyed_points.size());
  Tempo tempo{.tolerance = options.function_tolerance};
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
