#include "bundle_adjustment/memory_estimate.h"

#include <malloc.h>

#include <cmath>
#include <fstream>

#include "base/memory.h"
#include "base/sanitized.h"
#include "cairn/synthetic/scene.h"
#include "support/test.h"

namespace cairn {
namespace {

TEST(EstimateBundleBytes, GrowsWithWhatThereIs) {
  const BundleAdjustmentOptions options;
  const BundleSize size{.num_images = 100,
                        .num_keypoints = 100000,
                        .num_points = 10000,
                        .num_observations = 50000,
                        .covisibility = 5};
  const int64_t bytes = EstimateBundleBytes(options, size);
  for (int64_t BundleSize::*field : {&BundleSize::num_images, &BundleSize::num_keypoints,
                                     &BundleSize::num_points, &BundleSize::num_observations}) {
    BundleSize larger = size;
    larger.*field *= 2;
    EXPECT_GT(EstimateBundleBytes(options, larger), bytes);
  }
  // The cameras' system.
  BundleSize paired = size;
  paired.num_image_pairs = 1000;
  EXPECT_GT(EstimateBundleBytes(options, paired),
            EstimateBundleBytes(options, size) + int64_t{1000} * 36 * sizeof(double));
  BundleSize full = size;
  full.num_images = paired.num_images = 1000;
  paired.covisibility = full.covisibility = 200;  // it is not formed
  EXPECT_EQ(EstimateBundleBytes(options, paired), EstimateBundleBytes(options, full));
  // A full Schur complement of thousands of images, or none at all.
  BundleSize many = size;
  many.num_images = 5000;
  BundleAdjustmentOptions dense;
  dense.solver = BundleSolver::kDenseSchur;
  EXPECT_GT(EstimateBundleBytes(dense, many), 3 * EstimateBundleBytes(options, many));
}

TEST(ReadMemoryUse, KnowsThisProcess) {
  const MemoryUse use = ReadMemoryUse();
  EXPECT_GT(use.resident, 1 << 20);
  EXPECT_GE(use.peak, use.resident);
  EXPECT_GT(use.available, 0);
}

// Two rows of 3 + 6 + 2 entries: 97 million observations.
TEST(MaxBundleObservations, KeepsTheJacobianWithinInt) {
  BundleAdjustmentOptions options;
  options.solver = BundleSolver::kSparseSchur;
  const int64_t most =
      MaxBundleObservations(options, {.num_images = 1000, .num_free_intrinsics = 2});
  EXPECT_LE(22 * most, (int64_t{1} << 31) - 1);
  EXPECT_GT(22 * (most + 1), (int64_t{1} << 31) - 1);
  EXPECT_NEAR(static_cast<double>(most), 97.6e6, 0.1e6);
  // Without a Jacobian of all observations at once.
  options.solver = BundleSolver::kAuto;
  EXPECT_EQ(MaxBundleObservations(options, {.num_images = 1000, .num_free_intrinsics = 2}),
            (int64_t{1} << 31) - 1);
}

// With a camera of this model for all images, or for each.
Reconstruction WithCameras(Reconstruction model, CameraModel camera_model, bool has_own_cameras) {
  const Camera before = model.cameras.begin()->second;
  model.cameras.clear();
  for (auto& [id, image] : model.images) {
    image.image.camera_id = has_own_cameras ? id : 1;
    model.cameras[image.image.camera_id] = Camera::FromFocal(
        image.image.camera_id, camera_model, before.MeanFocal(), before.width, before.height);
  }
  return model;
}

// The kernel can forget the largest size until now, so that what a few lines take can be measured.
TEST(EstimateBundleBytes, IsWithinThirtyPercentOfWhatIsTaken) {
  if (CAIRN_SANITIZED) GTEST_SKIP() << "sanitizers take memory of their own";
  SceneOptions scene;
  scene.num_images = 40;
  scene.num_points = 30000;
  scene.max_keypoints = 4000;
  scene.image_noise_px = 0.5;
  const Reconstruction truth = MakeScene(scene, 1).truth;
  BundleSize size{.num_images = scene.num_images,
                  .num_points = static_cast<int64_t>(truth.points3D.size()),
                  .num_observations = truth.NumObservations(),
                  .num_image_pairs = scene.num_images * (scene.num_images + 1) / 2};
  for (const auto& [id, image] : truth.images) {
    size.num_keypoints += static_cast<int64_t>(image.points2D.size());
  }
  for (const auto& [id, point] : truth.points3D) {
    size.covisibility += std::pow(static_cast<double>(point.track.size()), 2) /
                         static_cast<double>(size.num_observations);
  }
  struct Case {
    BundleSolver solver = BundleSolver::kAuto;
    CameraModel camera_model = CameraModel::kSimpleRadial;
    bool has_own_cameras = false;
  };
  for (const auto& [solver, camera_model, has_own_cameras] :
       {Case{}, Case{.solver = BundleSolver::kDenseSchur},
        Case{.camera_model = CameraModel::kOpenCV}, Case{.camera_model = CameraModel::kFullOpenCV},
        Case{.has_own_cameras = true}}) {
    const Reconstruction start = WithCameras(truth, camera_model, has_own_cameras);
    size.num_free_intrinsics = static_cast<int>(start.cameras.begin()->second.params.size());
    size.has_own_cameras = has_own_cameras;
    BundleAdjustmentScope scope;
    scope.focal_lengths = scope.distortions = true;
    Reconstruction model;
    malloc_trim(0);
    std::ofstream("/proc/self/clear_refs") << "5";
    const MemoryUse before = ReadMemoryUse();
    if (before.peak > before.resident + (1 << 22)) GTEST_SKIP() << "the peak cannot be reset";
    model = start;
    BundleAdjustmentOptions options;
    options.max_iterations = 3;
    options.solver = solver;
    AdjustBundle(model, scope, options, {.num_threads = 1});
    const auto taken = static_cast<double>(ReadMemoryUse().peak - before.resident);
    ASSERT_GT(taken, 3e7);
    EXPECT_NEAR(static_cast<double>(EstimateBundleBytes(options, size)) / taken, 1.0, 0.3)
        << static_cast<int>(solver) << CameraModelName(camera_model) << has_own_cameras;
  }
}

}  // namespace
}  // namespace cairn
