#pragma once

#include <ceres/loss_function.h>

#include <cstdint>

#include "bundle_adjustment/bundle_state.h"
#include "cairn/base/run_context.h"
#include "math/levenberg_marquardt.h"

namespace cairn {

// What LargeBundle keeps of an observation: it as it was, linearized in single precision, and its
// place in its image's list.
inline constexpr int64_t kLargeBundleObservationBytes = 24 + 112 + 8;

struct LargeBundleReport {
  LevenbergMarquardtReport solution;
  double initial_cost = 0;
  int64_t num_points = 0;
  int64_t num_observations = 0;
};

// The length of the error of a position, in standard deviations, from which its loss is Huber's: 1
// in 20 vectors of three normal coordinates exceeds it.
inline constexpr double kPositionLossScale = 2.796;

// Poses or positions, points and, with rotations, intrinsics; no surveyed points.
bool SuitsLargeBundle(const BundleAdjustmentScope& scope);

// Bundle adjustment of thousands of images that each see their own part: Levenberg-Marquardt, the
// points eliminated, the cameras' system formed row by row (no two threads write to one block) and
// solved by conjugate gradients (camera_system.h). What Ceres' ITERATIVE_SCHUR does with an
// explicit complement, without a hash table of blocks and a lock for each. Equal for any number of
// threads. `state` is left adjusted. loss: null for none.
LargeBundleReport AdjustLargeBundle(const LevenbergMarquardtOptions& options,
                                    const BundleAdjustmentScope& scope,
                                    const Reconstruction& reconstruction,
                                    const ceres::LossFunction* loss, const RunContext& run,
                                    BundleState& state);

}  // namespace cairn
