#include "bundle_adjustment/memory_estimate.h"

#include <algorithm>
#include <cmath>
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

// Pairs of images that have a block in the cameras' system. (To factorize a full one is the most.)
int64_t NumFormedPairs(const BundleSize& size, int block) {
  const SchurFlops flops(block, size.num_observations, size.covisibility);
  const double factor = std::pow(kPoseSize * size.num_images, 3) / 3;
  const double least = std::min(flops.ByBlocks(size.num_image_pairs), factor);
  return flops.form + least <= flops.by_points ? size.num_image_pairs : 0;
}

// Is the system factorized? That of few images is, and of many, one in which images have few
// neighbors: a city's with a hundred is not (scripts/measure_scale).
bool IsLikelyFactorized(const BundleSize& size) {
  constexpr int64_t kFewImages = 500, kFewNeighbors = 50;
  return size.num_images <= kFewImages || size.num_image_pairs <= kFewNeighbors * size.num_images;
}

// A pair of images: its block and its column, once more while they are found; where the system is
// factorized, rows and values of the entries, here and in CHOLMOD, and the factor.
int64_t SchurBytesPerImagePair(const BundleSize& size, int64_t block) {
  const int64_t in_block = block * block * int64_t{sizeof(double)} + 3 * int64_t{sizeof(int32_t)};
  const int64_t unknowns = size.has_own_cameras ? kPoseSize + size.num_free_intrinsics : kPoseSize;
  const int64_t in_factor = unknowns * unknowns * 5 * int64_t{sizeof(double)};
  return in_block + (IsLikelyFactorized(size) ? in_factor : 0);
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
           size.num_points * (kBytesOfPoint + kSchurBytesPerPoint) +
           NumFormedPairs(size, block) * SchurBytesPerImagePair(size, block);
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
