#include "cairn/bundle_adjustment/pose_confidence.h"

#include <cmath>

#include "cairn/base/rng.h"
#include "cairn/bundle_adjustment/bundle_adjustment.h"
#include "cairn/math/angles.h"
#include "math/random_vectors.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"

namespace cairn {
namespace {

TEST(PoseConfidence, IsTheSpreadOfPosesUnderNoise) {
  Reconstruction truth = MakeSyntheticScene({.num_images = 6, .num_points = 60}).truth;
  for (auto& [id, image] : truth.images) image.sigmas_px.assign(image.points2D.size(), 0.5f);
  const PoseConfidence expected = EstimatePoseConfidence(truth).at(3);
  BundleAdjustmentScope scope;
  scope.fixed_images = {1, 2, 4, 5, 6};
  const Rigid3d true_pose = truth.images.at(3).cam_from_world;
  double squared_center = 0, squared_angle = 0;
  constexpr int kTrials = 60;
  Rng rng(5);
  for (int trial = 0; trial < kTrials; ++trial) {
    Reconstruction model = truth;
    for (auto& [id, image] : model.images) {
      for (Eigen::Vector2d& pixel : image.points2D) {
        pixel += 0.5 * GaussianVector<2>(rng);
      }
    }
    AdjustBundle(model, scope, {.loss = ReprojectionLoss::kNone}, kOneThread);
    const Rigid3d& pose = model.images.at(3).cam_from_world;
    squared_center += (pose.Center() - true_pose.Center()).squaredNorm();
    squared_angle += std::pow(RadToDeg(AngleBetween(pose.rotation, true_pose.rotation)), 2);
  }
  EXPECT_NEAR(std::sqrt(squared_center / kTrials) / expected.position_sigma, 1.0, 0.25);
  EXPECT_NEAR(std::sqrt(squared_angle / kTrials) / expected.rotation_sigma_deg, 1.0, 0.25);
}

TEST(PoseConfidence, IsInfiniteWithoutEnoughPoints) {
  Reconstruction model = MakeSyntheticScene({.num_images = 4, .num_points = 30}).truth;
  const auto ids = model.images.at(2).point3D_ids;
  int num_left = 2;
  for (size_t k = 0; k < ids.size(); ++k) {
    if (ids[k] == kInvalidPoint3DId || num_left-- > 0) continue;
    model.RemoveObservation(ids[k], {2, static_cast<point2D_t>(k)});
  }
  const auto confidences = EstimatePoseConfidence(model);
  EXPECT_EQ(confidences.at(2).num_points, 2);
  EXPECT_GT(confidences.at(2).position_sigma, 1e3 * confidences.at(1).position_sigma);
}

TEST(PoseConfidence, DoesNotDependOnThreads) {
  const Reconstruction model = MakeSyntheticScene({.num_images = 6, .num_points = 200}).truth;
  const auto one = EstimatePoseConfidence(model, {.num_threads = 1});
  const auto eight = EstimatePoseConfidence(model, {.num_threads = 8});
  ASSERT_EQ(one.size(), 6u);
  for (const auto& [id, confidence] : one) {
    EXPECT_EQ(confidence.num_points, eight.at(id).num_points);
    EXPECT_EQ(confidence.rotation_sigma_deg, eight.at(id).rotation_sigma_deg);
    EXPECT_EQ(confidence.position_sigma, eight.at(id).position_sigma);
  }
}

// Two images know the direction to each other, and not how far apart they are.
TEST(PoseConfidence, OfTwoImagesIsThatOfRotations) {
  const auto sigma_deg = [](int num_images) {
    const Reconstruction model =
        MakeSyntheticScene({.num_images = num_images, .num_points = 60}).truth;
    const PoseConfidence confidence = EstimatePoseConfidence(model).at(2);
    EXPECT_EQ(std::isinf(confidence.position_sigma), num_images == 2);
    return confidence.rotation_sigma_deg;
  };
  EXPECT_GT(sigma_deg(2), sigma_deg(3));
  EXPECT_LT(sigma_deg(2), 30 * sigma_deg(3));
}

}  // namespace
}  // namespace cairn
