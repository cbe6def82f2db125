#include "cairn/two_view/pair_verifier.h"
#include "math/random_vectors.h"
#include "support/test.h"
#include "two_view/pair_fixture.h"

namespace cairn {
namespace {

PairReport VerifyFivePoint(const Pair& pair, const TwoViewOptions& options = {}) {
  return MakePairVerifier(VerifierKind::kFivePoint, options)->Verify(pair.Input(false));
}

Rigid3d SomeMotion() {
  return Rigid3d(ExpSO3(Eigen::Vector3d(0.05, -0.15, 0.1)), Eigen::Vector3d(0.9, 0.2, -0.3));
}

TEST(SpecialPairs, AllPointsOfOnePlane) {
  Pair pair = MakePlanarPair(SomeMotion(), false, 150, 0.2, 1);
  pair.cam2_from_cam1.translation.normalize();
  const PairReport report = VerifyFivePoint(pair);
  ASSERT_EQ(report.status, PairStatus::kVerified);
  EXPECT_EQ(report.geometry.config, TwoViewConfig::kPlanar);
  ASSERT_TRUE(report.geometry.H.has_value());
  for (const FeatureMatch& match : report.geometry.inlier_matches) {
    const Eigen::Vector2d x2 =
        (*report.geometry.H * pair.keypoints1[match.point1].Position().homogeneous()).hnormalized();
    EXPECT_LT((x2 - pair.keypoints2[match.point2].Position()).norm(), 4.0);
  }
  // One of the two motions that a plane leaves; its rotation need not be the true one.
  EXPECT_TRUE(report.geometry.cam2_from_cam1.has_value());
}

TEST(SpecialPairs, SomePointsOffThePlaneDecideBetweenItsMotions) {
  int num_right = 0;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    Pair plane = MakePlanarPair(SomeMotion(), false, 150, 0.2, seed);
    plane.cam2_from_cam1.translation.normalize();
    Rng rng(seed);
    for (int i = 0; i < 25; ++i) {
      Eigen::Vector3d X = UniformVector({{-1.0, 1.0}, {-1.0, 1.0}, {2.5, 3.5}}, rng);
      const Eigen::Vector3d X2 = SomeMotion() * X;
      const auto k = static_cast<point2D_t>(plane.matches.size());
      auto add = [](const Camera& camera, const Eigen::Vector3d& Y, std::vector<Keypoint>* out) {
        const Eigen::Vector2d pixel = camera.ImgFromCam(Y.hnormalized());
        out->push_back(RoundKeypoint(pixel));
      };
      add(plane.camera1, X, &plane.keypoints1);
      add(plane.camera2, X2, &plane.keypoints2);
      plane.matches.push_back({k, k});
    }
    const PairReport report = VerifyFivePoint(plane);
    ASSERT_EQ(report.status, PairStatus::kVerified);
    EXPECT_EQ(report.geometry.config, TwoViewConfig::kPlanar);
    num_right += PoseErrorDeg(report, plane) < 1.0;
  }
  EXPECT_GE(num_right, 19);
}

TEST(SpecialPairs, PureRotationHasNoTranslation) {
  const Pair pair = MakePlanarPair(SomeMotion(), true, 150, 0.3, 2);
  const PairReport report = VerifyFivePoint(pair);
  ASSERT_EQ(report.status, PairStatus::kVerified);
  EXPECT_EQ(report.geometry.config, TwoViewConfig::kPanoramic);
  ASSERT_TRUE(report.geometry.cam2_from_cam1.has_value());
  EXPECT_TRUE(report.geometry.cam2_from_cam1->translation.isZero());
  EXPECT_LT(AngleBetween(report.geometry.cam2_from_cam1->rotation, pair.cam2_from_cam1.rotation),
            0.002);
  EXPECT_GE(report.num_inliers, 140);
  EXPECT_TRUE(report.geometry.H.has_value());
  EXPECT_EQ(report.triangulation_angle_deg, 0.0);
}

// What a plane or a rotation leaves is noise, whatever the threshold: here 0.6 of it.
TEST(SpecialPairs, NoisyPlanesAndRotationsAreKnown) {
  int num_planar = 0, num_panoramic = 0;
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    const auto config_of = [&](bool rotation_only) {
      const Pair pair = MakePlanarPair(SomeMotion(), rotation_only, 60, 1.36, seed);
      return VerifyFivePoint(pair).geometry.config;
    };
    num_planar += config_of(false) == TwoViewConfig::kPlanar;
    num_panoramic += config_of(true) == TwoViewConfig::kPanoramic;
  }
  EXPECT_GE(num_planar, 9);
  EXPECT_GE(num_panoramic, 9);
}

// A scene whose points are mostly too far away to show a translation; without a rotation they do
// not move at all, as marks do.
Pair MakeFarPair(double far_share, bool is_turned, uint64_t seed, double near_depth = 10.0) {
  Pair pair = MakePlanarPair(SomeMotion(), true, 0, 0, seed);
  if (!is_turned) pair.cam2_from_cam1.rotation.setIdentity();
  pair.cam2_from_cam1.translation = Eigen::Vector3d(0.98, 0.1, 0.17).normalized();
  Rng rng(seed, "far");
  while (pair.matches.size() < 600) {
    const Eigen::Vector3d ray = UniformVector({{-0.6, 0.6}, {-0.6, 0.6}}, rng).homogeneous();
    const double depth = rng.Uniform(0, 1) < far_share ? 1e5 : near_depth * rng.Uniform(1, 6);
    const Eigen::Vector3d X2 = pair.cam2_from_cam1 * Eigen::Vector3d(depth * ray);
    if ((X2.head<2>() / X2.z()).cwiseAbs().maxCoeff() > 0.75) continue;
    const auto k = static_cast<point2D_t>(pair.matches.size());
    const auto add = [&](const Eigen::Vector2d& pixel, std::vector<Keypoint>& keypoints) {
      keypoints.push_back(RoundKeypoint(pixel + 0.3 * GaussianVector<2>(rng)));
    };
    add(pair.camera1.ImgFromCam(ray.head<2>()), pair.keypoints1);
    add(pair.camera2.ImgFromCam(X2.hnormalized()), pair.keypoints2);
    pair.matches.push_back({k, k});
  }
  return pair;
}

TEST(SpecialPairs, WhatIsNearTellsTheTranslation) {
  for (const bool is_turned : {true, false}) {
    int num_right = 0;
    for (uint64_t seed = 0; seed < 10; ++seed) {
      const Pair pair = MakeFarPair(is_turned ? 0.9 : 0.65, is_turned, seed);
      num_right += PoseErrorDeg(VerifyFivePoint(pair), pair) < 3;
    }
    EXPECT_GE(num_right, is_turned ? 9 : 7) << is_turned;
    EXPECT_EQ(VerifyFivePoint(MakeFarPair(1, is_turned, 1)).geometry.config,
              TwoViewConfig::kPanoramic);
  }
}

// Most points are within two thresholds of a rotation, but not within their noise of it; or those
// that are off it are within four.
TEST(SpecialPairs, LittleParallaxTellsTheTranslationWhereThereIsLittleNoise) {
  for (const double far_share : {0.0, 0.85}) {
    int num_right = 0;
    for (uint64_t seed = 0; seed < 10; ++seed) {
      const Pair pair = MakeFarPair(far_share, true, seed, 120);
      num_right += PoseErrorDeg(VerifyFivePoint(pair), pair) < 5;
    }
    EXPECT_GE(num_right, 9) << far_share;
  }
}

// Inliers may be as far off as two coordinates may be, and the score is by that.
TEST(SpecialPairs, EveryInlierOfARotationSpeaksForIt) {
  const Pair pair = MakePlanarPair(SomeMotion(), true, 150, 0.6, 2);
  const PairReport report = VerifyFivePoint(pair);
  ASSERT_EQ(report.geometry.config, TwoViewConfig::kPanoramic);
  EXPECT_GT(report.score, 0.75 * report.num_inliers);
}

TEST(SpecialPairs, AGeneralSceneIsNone) {
  const PairReport report = VerifyFivePoint(MakePair({}, 1));
  EXPECT_EQ(report.geometry.config, TwoViewConfig::kCalibrated);
  const PairReport forced = VerifyFivePoint(MakePair({}, 1), {.min_special_share = 0.0});
  EXPECT_NE(forced.geometry.config, TwoViewConfig::kCalibrated);
}

// Marks in the frame of both images at the same pixels.
TEST(SpecialPairs, Watermark) {
  Pair pair = MakePair({.num_inliers = 0, .num_outliers = 60}, 3);
  Rng rng(3);
  for (int i = 0; i < 80; ++i) {
    const Eigen::Vector2d pixel = UniformVector({{1000.0, 1590.0}, {1480.0, 1590.0}}, rng);
    const auto k = static_cast<point2D_t>(pair.keypoints1.size());
    for (auto* keypoints : {&pair.keypoints1, &pair.keypoints2}) {
      keypoints->push_back(RoundKeypoint(pixel + 0.1 * GaussianVector<2>(rng)));
    }
    pair.matches.push_back({k, k});
  }
  const PairReport report = VerifyFivePoint(pair);
  ASSERT_EQ(report.status, PairStatus::kVerified);
  EXPECT_EQ(report.geometry.config, TwoViewConfig::kWatermark);
  EXPECT_FALSE(report.geometry.cam2_from_cam1.has_value());
  const PairReport other = VerifyFivePoint(pair, {.detect_watermark = false});
  EXPECT_NE(other.geometry.config, TwoViewConfig::kWatermark);
}

// Marks all over both images, as agencies print them, on unrelated photographs: every mark matches
// itself or another one of its row.
Pair MakeOverlay(double focal2_px, uint64_t seed) {
  Pair pair = MakePair({.num_inliers = 0, .num_outliers = 60, .focal2_px = focal2_px}, seed);
  Rng rng(seed);
  for (int i = 0; i < 150; ++i) {
    const Eigen::Vector2d letter = UniformVector({{0.0, 100.0}, {0.0, 30.0}}, rng);
    const double mark_y = 200.0 * rng.UniformInt(8);
    const Eigen::Vector2d mark(300.0 * rng.UniformInt(5), mark_y);
    const double moved = i % 3 == 0 ? 300.0 * (1.0 + rng.UniformInt(3)) : 0.0;
    const auto k = static_cast<point2D_t>(pair.keypoints1.size());
    auto add = [&](const Eigen::Vector2d& pixel, std::vector<Keypoint>* keypoints) {
      keypoints->push_back(RoundKeypoint(pixel + 0.2 * GaussianVector<2>(rng)));
    };
    add(letter + mark, &pair.keypoints1);
    add(letter + mark + Eigen::Vector2d(moved, 0.0), &pair.keypoints2);
    pair.matches.push_back({k, k});
  }
  return pair;
}

TEST(SpecialPairs, NoShareOfMarksIsNeededWhereThereAreNone) {
  Pair pair = MakePair({.num_outliers = 0}, 1);
  // All matches away from the frame of a larger image.
  for (Camera* camera : {&pair.camera1, &pair.camera2}) {
    camera->width = camera->height = 8000;
    camera->params[1] = camera->params[2] = 4000.0;
  }
  for (auto* keypoints : {&pair.keypoints1, &pair.keypoints2}) {
    for (Keypoint& keypoint : *keypoints) keypoint.x += 3200.0f, keypoint.y += 3200.0f;
  }
  const PairReport report = VerifyFivePoint(pair, {.min_special_share = 0.0});
  EXPECT_NE(report.geometry.config, TwoViewConfig::kWatermark);
}

TEST(SpecialPairs, MarksAllOverUnrelatedImagesAreNoScene) {
  for (const bool is_trusted : {true, false}) {
    for (uint64_t seed = 0; seed < 5; ++seed) {
      Pair pair = MakeOverlay(1000.0, seed);
      pair.camera1.has_prior_focal_length = pair.camera2.has_prior_focal_length = is_trusted;
      for (const VerifierKind kind : {VerifierKind::kCascade, VerifierKind::kFivePoint}) {
        const PairReport report = MakePairVerifier(kind, {})->Verify(pair.Input(false));
        ASSERT_EQ(report.status, PairStatus::kVerified);
        EXPECT_EQ(report.geometry.config, TwoViewConfig::kWatermark) << is_trusted << seed;
        EXPECT_FALSE(report.geometry.cam2_from_cam1.has_value());
        EXPECT_FALSE(report.geometry.F.has_value());
      }
    }
  }
  const PairReport other = VerifyFivePoint(MakeOverlay(1000.0, 1), {.detect_watermark = false});
  EXPECT_NE(other.geometry.config, TwoViewConfig::kWatermark);
}

// The same marks on photographs of one scene, which has fewer matches than they.
TEST(SpecialPairs, MarksDoNotHideTheSceneUnderThem) {
  for (const bool is_trusted : {true, false}) {
    for (uint64_t seed = 0; seed < 5; ++seed) {
      Pair pair = MakePair({.num_inliers = 100, .num_outliers = 20}, seed);
      const size_t num_before = pair.matches.size();
      const Pair marks = MakeOverlay(1000.0, seed);
      for (const FeatureMatch& match : marks.matches) {
        const auto k = static_cast<point2D_t>(pair.keypoints1.size());
        pair.keypoints1.push_back(marks.keypoints1[match.point1]);
        pair.keypoints2.push_back(marks.keypoints2[match.point2]);
        pair.matches.push_back({k, k});
      }
      pair.camera1.has_prior_focal_length = pair.camera2.has_prior_focal_length = is_trusted;
      const PairReport report =
          MakePairVerifier(VerifierKind::kCascade, {})->Verify(pair.Input(false));
      ASSERT_EQ(report.status, PairStatus::kVerified);
      EXPECT_EQ(report.geometry.config,
                is_trusted ? TwoViewConfig::kCalibrated : TwoViewConfig::kUncalibrated);
      ASSERT_TRUE(report.geometry.cam2_from_cam1.has_value());
      EXPECT_LT(PoseErrorDeg(report, pair), 1.0);
      EXPECT_GT(std::ranges::count_if(report.geometry.inlier_matches,
                                      [&](const FeatureMatch& m) { return m.point1 < num_before; }),
                90);
    }
  }
}

TEST(SpecialPairs, ATinyPatchFixesNoPose) {
  Pair pair = MakePair({.num_inliers = 0, .num_outliers = 30}, 4);
  Rng rng(4);
  for (int i = 0; i < 60; ++i) {
    const auto k = static_cast<point2D_t>(pair.keypoints1.size());
    const Eigen::Vector2d offset = UniformVector({{-4.0, 4.0}, {-4.0, 4.0}}, rng);
    for (auto* keypoints : {&pair.keypoints1, &pair.keypoints2}) {
      const Eigen::Vector2d pixel = Eigen::Vector2d(800.0, 700.0) + offset;
      keypoints->push_back(RoundKeypoint(pixel + 0.2 * GaussianVector<2>(rng)));
    }
    pair.matches.push_back({k, k});
  }
  const PairReport report = VerifyFivePoint(pair);
  EXPECT_TRUE(report.status == PairStatus::kDegenerate ||
              report.geometry.config == TwoViewConfig::kPanoramic ||
              report.status == PairStatus::kTooFewInliers)
      << PairStatusName(report.status) << TwoViewConfigName(report.geometry.config);
}

// Their rotation alone, in which the translation had a part, explains few of the matches.
TEST(SpecialPairs, SmallPatchesWithReliefAreNeverVerifiedByFewMatches) {
  const TwoViewOptions options{.max_iterations = 300};
  int num_panoramic = 0, num_degenerate = 0;
  for (int seed = 0; seed < 1000; ++seed) {
    Pair pair;
    pair.camera1 = MakeCamera(1, 1000.0, 0.0);
    pair.camera2 = MakeCamera(2, 1200.0, 0.0);
    Rng rng(seed, "patch");
    const int num_points = 25 + static_cast<int>(rng.UniformInt(36));
    const double size = rng.Uniform(0.01, 0.05);
    const Eigen::Vector3d middle(rng.Uniform(-1, 1), rng.Uniform(-1, 1), 5);
    const Rigid3d motion(ExpSO3(0.1 * GaussianVector<3>(rng)), 0.5 * GaussianVector<3>(rng));
    for (int i = 0; i < num_points; ++i) {
      const Eigen::Vector3d X = middle + 5 * size * GaussianVector<3>(rng);
      const auto add = [&](const Camera& camera, const Eigen::Vector3d& in_camera,
                           auto& keypoints) {
        const Eigen::Vector2d pixel = camera.ImgFromCam(in_camera.hnormalized());
        keypoints.push_back(RoundKeypoint(pixel + 0.4 * GaussianVector<2>(rng)));
      };
      add(pair.camera1, X, pair.keypoints1);
      add(pair.camera2, motion * X, pair.keypoints2);
      pair.matches.push_back({static_cast<point2D_t>(i), static_cast<point2D_t>(i)});
    }
    const PairReport report = VerifyFivePoint(pair, options);
    num_degenerate += report.status == PairStatus::kDegenerate;
    if (report.status != PairStatus::kVerified) continue;
    num_panoramic += report.geometry.config == TwoViewConfig::kPanoramic;
    EXPECT_GE(std::ssize(report.geometry.inlier_matches), options.min_num_inliers) << seed;
  }
  EXPECT_GT(num_panoramic, 10);
  EXPECT_GT(num_degenerate, 0);
}

PairReport VerifyByFrames(const TwoViewProblem& problem, const TwoViewOptions& options) {
  return MakePairVerifier(VerifierKind::kCascade, options)->Verify(InputByFrames(problem));
}

// A wall seen twice in one pair, as two identical facades are: `num_second` matches tell of another
// motion than the first 200.
PairReport VerifyTwoWalls(int num_second, const TwoViewOptions& options = {}) {
  TwoViewProblemOptions wall;
  wall.num_matches = 200;
  wall.noise.image_px = 0.3;
  TwoViewProblem first = MakeTwoViewProblem(wall, 1);
  wall.num_matches = num_second;
  const TwoViewProblem second = MakeTwoViewProblem(wall, 2);
  const auto offset = static_cast<point2D_t>(first.keypoints1.size());
  first.keypoints1.insert(first.keypoints1.end(), second.keypoints1.begin(),
                          second.keypoints1.end());
  first.keypoints2.insert(first.keypoints2.end(), second.keypoints2.begin(),
                          second.keypoints2.end());
  for (const FeatureMatch& match : second.matches) {
    first.matches.push_back({match.point1 + offset, match.point2 + offset});
  }
  return VerifyByFrames(first, options);
}

TEST(SpecialPairs, TwoModelsOfRepeatedStructureGiveNoPose) {
  const PairReport ambiguous = VerifyTwoWalls(160);
  ASSERT_EQ(ambiguous.status, PairStatus::kVerified);
  EXPECT_EQ(ambiguous.geometry.config, TwoViewConfig::kMultiple);
  EXPECT_FALSE(ambiguous.geometry.cam2_from_cam1.has_value());
  EXPECT_GT(ambiguous.num_inliers, 300);
  // A few wrong ones do no harm, and how many these are is an option.
  const PairReport clear = VerifyTwoWalls(40);
  ASSERT_EQ(clear.status, PairStatus::kVerified);
  EXPECT_EQ(clear.geometry.config, TwoViewConfig::kCalibrated);
  EXPECT_TRUE(clear.geometry.cam2_from_cam1.has_value());
  EXPECT_EQ(VerifyTwoWalls(160, {.min_competing_share = 2.0}).geometry.config,
            TwoViewConfig::kCalibrated);
}

// Pieces of a smooth surface that each moved elsewhere in the second image, as windows of a facade
// do when every one matches another one.
PairReport VerifyPieces(int num_pieces, const TwoViewOptions& options = {}) {
  TwoViewProblemOptions wall;
  wall.num_matches = 400;
  wall.noise.image_px = 0.3;
  TwoViewProblem problem = MakeTwoViewProblem(wall, 1);
  Rng rng(1);
  const double width = problem.camera1.width / static_cast<double>(num_pieces);
  std::vector<Eigen::Vector2d> shifts;
  for (int i = 0; i < num_pieces * num_pieces; ++i) {
    const Eigen::Vector2d shift = UniformVector({{-300.0, 300.0}, {-300.0, 300.0}}, rng);
    shifts.push_back(num_pieces > 1 ? shift : Eigen::Vector2d(0.0, 0.0));
  }
  for (const FeatureMatch& match : problem.matches) {
    const Keypoint& keypoint1 = problem.keypoints1[match.point1];
    Keypoint& keypoint2 = problem.keypoints2[match.point2];
    const int column = std::clamp(static_cast<int>(keypoint1.x / width), 0, num_pieces - 1);
    const int row = std::clamp(static_cast<int>(keypoint1.y / width), 0, num_pieces - 1);
    keypoint2.x += static_cast<float>(shifts[row * num_pieces + column].x());
    keypoint2.y += static_cast<float>(shifts[row * num_pieces + column].y());
  }
  return VerifyByFrames(problem, options);
}

TEST(SpecialPairs, OneOfManyPiecesGivesNoPose) {
  const PairReport whole = VerifyPieces(1);
  ASSERT_EQ(whole.status, PairStatus::kVerified);
  EXPECT_EQ(whole.geometry.config, TwoViewConfig::kCalibrated);
  for (const int num_pieces : {5, 6, 8}) {
    const PairReport report = VerifyPieces(num_pieces);
    ASSERT_EQ(report.status, PairStatus::kVerified);
    EXPECT_EQ(report.geometry.config, TwoViewConfig::kMultiple) << num_pieces;
    EXPECT_FALSE(report.geometry.cam2_from_cam1.has_value());
  }
  EXPECT_EQ(VerifyPieces(5, {.min_competing_share = 10.0}).geometry.config,
            TwoViewConfig::kCalibrated);
}

}  // namespace
}  // namespace cairn
