#pragma once

#include <algorithm>
#include <cstdint>

#include "bundle_adjustment/camera_system.h"
#include "cairn/base/run_context.h"
#include "cairn/bundle_adjustment/bundle_adjustment.h"

namespace cairn {

// The free intrinsics that a block of SchurBundle has room for, where no camera has more.
inline constexpr int IntrinsicsOfBlock(int num_free) {
  return num_free <= 4 ? 4 : num_free <= 8 ? 8 : kMaxCameraParams;
}

// Poses and points, with or without intrinsics.
bool SuitsSchurBundle(const BundleAdjustmentScope& scope);

// Operations for a cameras' system (camera_system.h) with blocks of so many unknowns; of conjugate
// gradients as many as there may be. They decide how it is solved.
struct SchurFlops {
  // covisibility: images that see an observation's point, on average.
  SchurFlops(int block, int64_t num_observations, double covisibility)
      : block(block),
        form(2.0 * block * block * static_cast<double>(num_observations) * covisibility),
        by_points(kMaxConjugateGradients * (8.0 * block + 24) *
                  static_cast<double>(num_observations)) {}

  // Conjugate gradients by products of the blocks of pairs of images, an image with itself among
  // them.
  double ByBlocks(int64_t num_pairs) const {
    return kMaxConjugateGradients * 4.0 * block * block * static_cast<double>(num_pairs);
  }
  // Blocks of pairs are formed, and factorized where that takes no more than this.
  double MostOfFactor(int64_t num_pairs) const {
    return std::min(ByBlocks(num_pairs), by_points - form);
  }
  // They are formed although they are not factorized.
  bool FormsWithoutFactor(int64_t num_pairs) const {
    return ByBlocks(num_pairs) <= by_points - form;
  }

  int block;
  double form;       // the blocks of pairs of images
  double by_points;  // conjugate gradients by way of the points (schur_product.h)
};

// Bundle adjustment by Levenberg-Marquardt: the points eliminated (Schur complement), the cameras'
// system formed row by row (no two threads write to one block) and solved (camera_system.h). Equal
// for any number of threads. What Ceres' dense, sparse and iterative Schur solvers do, without a
// hash table of blocks and a lock for each. The rest of the report is the caller's.
BundleAdjustmentReport AdjustBySchurBundle(const BundleAdjustmentOptions& options,
                                           const BundleAdjustmentScope& scope,
                                           const RunContext& run, Reconstruction& reconstruction);

}  // namespace cairn
