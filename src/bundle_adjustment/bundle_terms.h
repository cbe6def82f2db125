#pragma once

#include <ceres/loss_function.h>

#include <Eigen/Core>
#include <memory>

#include "bundle_adjustment/bundle_state.h"
#include "cairn/bundle_adjustment/bundle_adjustment.h"

namespace cairn {

// What an adjustment minimizes and when it ends, whichever solver makes it.

// The loss on reprojection errors; null for none.
std::unique_ptr<ceres::LossFunction> MakeLoss(const BundleAdjustmentOptions& options);

// The length of the error of a position, in standard deviations, from which its loss is Huber's: 1
// in 20 vectors of three normal coordinates exceeds it.
inline constexpr double kPositionLossScale = 2.796;

// What is expected of a camera's free intrinsics, as they stand in its parameter block, and
// 1 / standard deviation of each.
struct FreeIntrinsicsPrior {
  Eigen::VectorXd mean;
  Eigen::VectorXd precision;
};
FreeIntrinsicsPrior PriorOfFree(const Camera& camera, const IntrinsicsPrior& prior,
                                const IntrinsicsState& state);

// How an adjustment begins and ends.
struct Tempo {
  double initial_damping = 1e-4;  // as Ceres has it
  double tolerance = 0;
};
// The damping never vanishes, since it alone holds the world frame.
inline constexpr double kMinDamping = 1e-9;
Tempo TempoOf(const BundleAdjustmentOptions& options, const BundleAdjustmentScope& scope,
              int64_t num_observations);

// From costs (sums of squared errors after the loss) and the report's number of observations.
void SetRmse(double initial_cost, double final_cost, BundleAdjustmentReport& report);

}  // namespace cairn
