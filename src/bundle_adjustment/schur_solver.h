#pragma once

#include "cairn/bundle_adjustment/bundle_adjustment.h"

namespace cairn {

// The solver of the cameras' system that the options ask for, or that kAuto stands for. Where many
// images see the same points, that system is nearly full: forming and factorizing it costs more
// than conjugate gradients take. covisibility: images that see an observation's point, on average.
inline BundleSolver SchurSolver(const BundleAdjustmentOptions& options, int64_t num_images,
                                double covisibility) {
  constexpr double kMaxSparseCovisibility = 20.0;
  if (options.solver != BundleSolver::kAuto) return options.solver;
  if (num_images <= options.max_dense_images) return BundleSolver::kDenseSchur;
  const bool is_sparse = num_images <= 3 * static_cast<int64_t>(options.max_dense_images) ||
                         covisibility <= kMaxSparseCovisibility;
  return num_images <= options.max_sparse_images && is_sparse ? BundleSolver::kSparseSchur
                                                              : BundleSolver::kIterativeSchur;
}

// Is it a large bundle (large_bundle.h), where the scope allows? It forms the cameras' system for
// conjugate gradients. That takes as long as two or three products by way of the points for every
// image that sees a point, and a step of thousands of images takes a hundred products; with the
// system formed, these take a tenth.
inline bool IsLargeBundle(const BundleAdjustmentOptions& options, int64_t num_images,
                          double covisibility) {
  constexpr double kMaxFormedCovisibility = 40.0;
  return SchurSolver(options, num_images, covisibility) == BundleSolver::kIterativeSchur &&
         covisibility <= kMaxFormedCovisibility;
}

}  // namespace cairn
