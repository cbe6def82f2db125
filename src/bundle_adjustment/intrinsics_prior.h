#pragma once

#include <Eigen/Core>

#include "bundle_adjustment/bundle_state.h"

namespace cairn {

// What is expected of a camera's free intrinsics, as they stand in its parameter block, and
// 1 / standard deviation of each.
struct FreeIntrinsicsPrior {
  Eigen::VectorXd mean;
  Eigen::VectorXd precision;
};
FreeIntrinsicsPrior PriorOfFree(const Camera& camera, const IntrinsicsPrior& prior,
                                const IntrinsicsState& state);

}  // namespace cairn
