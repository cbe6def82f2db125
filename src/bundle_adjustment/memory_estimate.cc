#include "bundle_adjustment/memory_estimate.h"

#include <limits>

#include "bundle_adjustment/bundle_observations.h"
#include "bundle_adjustment/bundle_state.h"
#include "bundle_adjustment/reprojection_cost.h"
#include "bundle_adjustment/schur_bundle.h"

namespace cairn {
namespace {

constexpr int64_t kMalloc = 16;   // what an allocation costs beside its content
constexpr int64_t kMapNode = 48;  // of a std::map or std::set, without its content
constexpr int64_t kPointer = 8;
constexpr int64_t kPoseSize = 6;
constexpr int64_t kPointSize = 3;

// Cost function, with the sizes of its blocks; Ceres' residual block and its list of parameters;
// residuals and Jacobian (two rows of point and pose) with the structure of its rows.
constexpr int64_t kBytesPerObservation = sizeof(TrackElement) + sizeof(ReprojectionCost) + kMalloc +
                                         2 * sizeof(int32_t) + kMalloc +
                                         (32 + kMalloc + 2 * kPointer + kMalloc + 3 * kPointer) +
                                         2 * (kPointSize + kPoseSize) * sizeof(double) +
                                         (40 + 2 * kPointer + kMalloc) + 2 * 4 * sizeof(double);

// Point3D in its map with its track.
constexpr int64_t kBytesOfPoint = kMapNode + sizeof(point3D_t) + sizeof(Point3D) + 2 * kMalloc;

// Position; Ceres' parameter block, its entries in two maps and an ordering; its share of a dozen
// vectors; inverse of its block.
constexpr int64_t kCeresBytesPerPoint =
    kPointSize * sizeof(double) + (160 + kMalloc) + 3 * (kMapNode + 2 * kPointer + kMalloc) +
    12 * kPointSize * sizeof(double) + 2 * kPointSize * kPointSize * sizeof(double);

// As far as they are more than the reconstruction's own, of a SchurBundle.
// A point: position, inverse of its block, and what it has of the state, the next one, their
// gradients and a step.
constexpr int64_t kSchurBytesPerPoint = (3 + 9 + 7 * 3) * sizeof(double);

// An observation: it as it was, its derivatives by its image's block and by the point, its
// residual, its place in its image's list, its weight and its second derivative along a step.
int64_t SchurBytesPerObservation(int64_t block) {
  return sizeof(BundleObservation) + (2 * block + 2 * kPointSize + 2) * sizeof(float) + 8 + 4 + 8;
}

// The cameras' system, as SchurBundle solves it. A pair of images: its block and its column, once
// more while they are found; where it is factorized, rows and values of the entries, here and in
// CHOLMOD, and the factor.
int64_t SystemBytes(const BundleSize& size, int block) {
  const SchurFlops flops(block, size.num_observations, size.covisibility);
  const bool is_factorized = size.factor_flops <= flops.MostOfFactor(size.num_image_pairs);
  if (!is_factorized && !flops.FormsWithoutFactor(size.num_image_pairs)) return 0;
  const int64_t in_block = block * block * int64_t{sizeof(double)} + 3 * int64_t{sizeof(int32_t)};
  const int64_t unknowns = size.has_own_cameras ? kPoseSize + size.num_free_intrinsics : kPoseSize;
  const int64_t in_factor = unknowns * unknowns * 5 * int64_t{sizeof(double)};
  return size.num_image_pairs * (in_block + (is_factorized ? in_factor : 0));
}

constexpr int64_t kBytesPerKeypoint = sizeof(Eigen::Vector2d) + sizeof(point3D_t) + sizeof(float);

}  // namespace

int64_t EstimateBundleBytes(const BundleAdjustmentOptions& options, const BundleSize& size) {
  const int64_t rows = kPoseSize * size.num_images;
  const int64_t reconstruction = size.num_keypoints * kBytesPerKeypoint +
                                 size.num_images * static_cast<int64_t>(sizeof(PoseState));
  if (options.solver == BundleSolver::kAuto) {
    const int block = kPoseSize + IntrinsicsOfBlock(size.num_free_intrinsics);
    return reconstruction +
           size.num_observations *
               (static_cast<int64_t>(sizeof(TrackElement)) + SchurBytesPerObservation(block)) +
           size.num_points * (kBytesOfPoint + kSchurBytesPerPoint) + SystemBytes(size, block);
  }
  // The diagonal blocks, or the complement and its factor.
  const bool is_iterative = options.solver == BundleSolver::kIterativeSchur;
  const int64_t schur = rows * (is_iterative ? kPoseSize : rows) * int64_t{sizeof(double)};
  return reconstruction + size.num_observations * kBytesPerObservation +
         size.num_points * (kBytesOfPoint + kCeresBytesPerPoint) + schur;
}

int64_t MaxBundleObservations(const BundleAdjustmentOptions& options, const BundleSize& size) {
  const int64_t most = std::numeric_limits<int>::max();
  if (options.solver == BundleSolver::kAuto) return most;
  return most / (2 * (kPointSize + kPoseSize + size.num_free_intrinsics));
}

}  // namespace cairn
