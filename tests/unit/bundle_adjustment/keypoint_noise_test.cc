#include "bundle_adjustment/keypoint_noise.h"

#include <cmath>
#include <map>

#include "cairn/base/rng.h"
#include "cairn/bundle_adjustment/bundle_adjustment.h"
#include "math/random_vectors.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"

namespace cairn {
namespace {

constexpr double kFloorPx = 0.2;
constexpr double kPerScale = 0.1;

// An exact scene whose keypoints have scales from 1 to 20 and the noise that goes with them.
struct NoisyScene {
  Reconstruction model;
  KeypointScales scales;
};
NoisyScene MakeNoisyScene(int num_points, uint64_t seed = 0) {
  NoisyScene scene{
      MakeSyntheticScene({.num_images = 8, .num_points = num_points, .seed = seed}).truth, {}};
  Rng rng(seed, "keypoint_noise_test");
  for (auto& [id, image] : scene.model.images) {
    for (Eigen::Vector2d& pixel : image.points2D) {
      const double scale = std::exp(rng.Uniform(0.0, 3.0));
      const double sigma = std::hypot(kFloorPx, kPerScale * scale);
      pixel += sigma * GaussianVector<2>(rng);
      scene.scales[id].push_back(static_cast<float>(scale));
    }
  }
  return scene;
}

void SetSigmas(const KeypointNoise& noise, NoisyScene& scene) {
  for (auto& [id, image] : scene.model.images) {
    image.sigmas_px.clear();
    for (const float scale : scene.scales.at(id)) {
      image.sigmas_px.push_back(static_cast<float>(noise.SigmaPx(scale)));
    }
  }
}

TEST(KeypointNoise, IsFoundFromTheErrorsAfterAnAdjustment) {
  NoisyScene scene = MakeNoisyScene(2000);
  KeypointNoise noise;
  // Without weights, the errors of large keypoints spoil those of small ones.
  for (int round = 0; round < 3; ++round) {
    SetSigmas(noise, scene);
    AdjustBundle(scene.model, {}, {}, kOneThread);
    noise = EstimateKeypointNoise(scene.model, scene.scales);
  }
  EXPECT_NEAR(noise.floor_px, kFloorPx, 0.05);
  EXPECT_NEAR(noise.per_scale, kPerScale, 0.015);
}

// Of two views, a point leaves one of four coordinates of errors.
TEST(KeypointNoise, IsFoundFromPointsOfTwoViews) {
  NoisyScene scene = MakeNoisyScene(3000);
  for (auto& [id, scales] : scene.scales) scales.assign(scales.size(), 1.0f);
  Rng rng(1);
  const Reconstruction truth = MakeSyntheticScene({.num_images = 8, .num_points = 3000}).truth;
  for (auto& [id, image] : scene.model.images) {
    for (size_t k = 0; k < image.points2D.size(); ++k) {
      image.points2D[k] = truth.images.at(id).points2D[k] + GaussianVector<2>(rng);
    }
  }
  std::map<point3D_t, Track> tracks;
  for (const auto& [id, point] : scene.model.points3D) tracks[id] = point.track;
  for (const auto& [id, track] : tracks) {
    for (size_t k = 2; k < track.size(); ++k) scene.model.RemoveObservation(id, track[k]);
  }
  BundleAdjustmentScope points_alone;
  points_alone.rotations = points_alone.positions = false;
  AdjustBundle(scene.model, points_alone, {}, kOneThread);
  EXPECT_NEAR(EstimateKeypointNoise(scene.model, scene.scales).SigmaPx(1), 1.0, 0.05);
}

// Not all of very many points are looked at.
TEST(KeypointNoise, OfManyPointsIsThatOfFewer) {
  const NoisyScene few = MakeNoisyScene(20'000), many = MakeNoisyScene(250'000);
  const KeypointNoise of_few = EstimateKeypointNoise(few.model, few.scales);
  const KeypointNoise of_many = EstimateKeypointNoise(many.model, many.scales);
  EXPECT_NEAR(of_many.floor_px, of_few.floor_px, 0.02 * kFloorPx);
  EXPECT_NEAR(of_many.per_scale, of_few.per_scale, 0.02 * kPerScale);
}

TEST(KeypointNoise, IsOnePixelWhereThereIsTooLittleToTell) {
  const NoisyScene scene = MakeNoisyScene(30);
  const KeypointNoise noise = EstimateKeypointNoise(scene.model, scene.scales);
  EXPECT_EQ(noise.SigmaPx(1), 1.0);
  EXPECT_EQ(noise.SigmaPx(100), 1.0);
}

TEST(KeypointNoise, ExactKeypointsStillHaveSomeAndOneScaleNeedsNoSlope) {
  const MadeReconstruction exact = MakeSyntheticScene({.num_points = 500});
  KeypointScales scales;
  for (const auto& [id, image] : exact.truth.images) scales[id].assign(image.points2D.size(), 2.0f);
  const KeypointNoise noise = EstimateKeypointNoise(exact.truth, scales);
  EXPECT_EQ(noise.SigmaPx(2), 0.05);
}

TEST(KeypointNoise, WeighingMakesPosesMoreExact) {
  double with = 0, without = 0;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    NoisyScene scene = MakeNoisyScene(400, seed);
    const Reconstruction truth =
        MakeSyntheticScene({.num_images = 8, .num_points = 400, .seed = seed}).truth;
    const BundleAdjustmentOptions options{.loss = ReprojectionLoss::kNone};
    NoisyScene plain = scene;
    AdjustBundle(plain.model, {}, options, kOneThread);
    without += CompareAligned(plain.model, truth).center;
    SetSigmas({kFloorPx, kPerScale}, scene);
    AdjustBundle(scene.model, {}, options, kOneThread);
    with += CompareAligned(scene.model, truth).center;
  }
  EXPECT_LT(with, 0.7 * without);
}

}  // namespace
}  // namespace cairn
