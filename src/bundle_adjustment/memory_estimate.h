#pragma once

#include <cstdint>

#include "cairn/bundle_adjustment/bundle_adjustment.h"

namespace cairn {

struct BundleSize {
  int64_t num_images = 0;
  int64_t num_keypoints = 0;  // of these images
  int64_t num_points = 0;
  int64_t num_observations = 0;
  double covisibility = 0;  // images that see an observation's point, on average
  // Only for a SchurBundle: pairs of images that see a point together, an image with itself among
  // them, and the operations of a factorization of their poses' blocks.
  int64_t num_image_pairs = 0;
  double factor_flops = 0;
  int num_free_intrinsics = 0;   // of the camera that has most
  bool has_own_cameras = false;  // most images have a camera of their own
};

// Predicted peak memory, bytes, of a reconstruction of this size (points, tracks, keypoints of the
// images) while it is adjusted with everything free, by SchurBundle, or with cost functions,
// Jacobian and solver of Ceres. From the sizes of what is allocated; within a fifth of what was
// measured. Sparse and dense Schur complements are taken as full, so they are an upper bound.
int64_t EstimateBundleBytes(const BundleAdjustmentOptions& options, const BundleSize& size);

// The most observations that can be adjusted: Ceres counts the entries of the Jacobian (two rows an
// observation, of point, pose and intrinsics) by int, SchurBundle the observations.
int64_t MaxBundleObservations(const BundleAdjustmentOptions& options, const BundleSize& size);

}  // namespace cairn
