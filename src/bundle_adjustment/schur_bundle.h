#pragma once

#include <cstdint>

#include "cairn/base/run_context.h"
#include "cairn/bundle_adjustment/bundle_adjustment.h"

namespace cairn {

// The free intrinsics that a block of SchurBundle has room for, where no camera has more.
inline constexpr int IntrinsicsOfBlock(int num_free) {
  return num_free <= 4 ? 4 : num_free <= 8 ? 8 : kMaxCameraParams;
}

// Poses and points, with or without intrinsics.
bool SuitsSchurBundle(const BundleAdjustmentScope& scope);

// Does kAuto stand for it, where the scope suits? covisibility: images that see an observation's
// point, on average. To form the cameras' system takes as long as two or three products by way of
// the points for every image that sees a point. Of thousands of images that all see the same
// points, hundreds of products take less.
inline bool TakesSchurBundle(const BundleAdjustmentOptions& options, int64_t num_images,
                             double covisibility) {
  constexpr int64_t kFewImages = 500;
  constexpr double kMaxCovisibility = 40.0;
  return options.solver == BundleSolver::kAuto &&
         (num_images <= kFewImages || covisibility <= kMaxCovisibility);
}

// Bundle adjustment by Levenberg-Marquardt: the points eliminated (Schur complement), the cameras'
// system formed row by row (no two threads write to one block) and solved (camera_system.h). Equal
// for any number of threads. What Ceres' dense, sparse and iterative Schur solvers do, without a
// hash table of blocks and a lock for each. The rest of the report is the caller's.
BundleAdjustmentReport AdjustBySchurBundle(const BundleAdjustmentOptions& options,
                                           const BundleAdjustmentScope& scope,
                                           const RunContext& run, Reconstruction& reconstruction);

}  // namespace cairn
