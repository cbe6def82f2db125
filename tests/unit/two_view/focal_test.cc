// Pairs whose focal lengths are unknown or wrong.
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "math/random_vectors.h"
#include "support/test.h"
#include "two_view/decide/focal_plausibility.h"
#include "unit/two_view/pair_fixture.h"

namespace cairn {
namespace {

// How well F explains the right matches: their largest error in pixels.
double MedianErrorPx(const Pair& pair, const Eigen::Matrix3d& F) {
  std::vector<double> errors;
  for (size_t i = 0; i < pair.matches.size(); ++i) {
    if (!pair.is_inlier[i]) continue;
    errors.push_back(
        std::sqrt(SquaredSampsonError(F, pair.keypoints1[pair.matches[i].point1].Position(),
                                      pair.keypoints2[pair.matches[i].point2].Position())));
  }
  std::sort(errors.begin(), errors.end());
  return errors[errors.size() / 2];
}

// The pair as it is seen when both focal lengths were taken for `factor` times the right ones.
Pair WithFocals(Pair pair, double factor, bool has_prior) {
  for (Camera* camera : {&pair.camera1, &pair.camera2}) {
    camera->SetMeanFocal(factor * camera->MeanFocal());
    camera->has_prior_focal_length = has_prior;
  }
  return pair;
}

PairReport Verify(const Pair& pair, VerifierKind kind = VerifierKind::kCascade,
                  const TwoViewOptions& options = {}) {
  return MakePairVerifier(kind, options)->Verify(pair.Input());
}

TEST(FocalVerifier, TrustedCamerasKeepTheirEssentialMatrix) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const PairReport report = Verify(MakePair({.num_inliers = 200}, seed));
    ASSERT_EQ(report.status, PairStatus::kVerified);
    EXPECT_EQ(report.geometry.config, TwoViewConfig::kCalibrated);
    EXPECT_TRUE(report.geometry.E.has_value());
  }
}

TEST(FocalVerifier, UnknownFocalLengthsGiveAFundamentalMatrix) {
  for (const VerifierKind kind :
       {VerifierKind::kCascade, VerifierKind::kFast, VerifierKind::kOneAcDepth,
        VerifierKind::kTwoAc, VerifierKind::kFivePoint}) {
    const Pair pair = WithFocals(MakePair({.num_inliers = 200}, 1), 1.0, false);
    const PairReport report = Verify(pair, kind);
    ASSERT_EQ(report.status, PairStatus::kVerified);
    EXPECT_EQ(report.geometry.config, TwoViewConfig::kUncalibrated);
    ASSERT_TRUE(report.geometry.F.has_value());
    EXPECT_FALSE(report.geometry.E.has_value());
    EXPECT_LT(MedianErrorPx(pair, *report.geometry.F), 0.5);
    EXPECT_EQ(report.num_inliers, static_cast<int>(report.geometry.inlier_matches.size()));
    EXPECT_GE(report.num_inliers, 180);
    EXPECT_LT(PoseErrorDeg(report, pair), 1.0);
  }
}

TEST(FocalVerifier, TheResidualIsOfTheInliersUnderTheirMatrix) {
  for (const double factor : {1.0, 0.7}) {
    const Pair pair = WithFocals(MakePair({.num_inliers = 200}, 1), factor, false);
    const PairReport report = Verify(pair);
    ASSERT_TRUE(report.geometry.F.has_value());
    std::vector<double> errors_px;
    for (const FeatureMatch& match : report.geometry.inlier_matches) {
      errors_px.push_back(std::sqrt(SquaredSampsonError(*report.geometry.F,
                                                        pair.keypoints1[match.point1].Position(),
                                                        pair.keypoints2[match.point2].Position())));
    }
    EXPECT_NEAR(report.residual_px, UpperMedian(errors_px), 1e-3) << factor;
  }
}

// An essential matrix takes fewer matches than a fundamental one to be more than chance.
TEST(FocalVerifier, FewMatchesDoNotMakeAGuessedFocalLengthTrusted) {
  int num_verified = 0;
  for (uint64_t seed = 0; seed < 60; ++seed) {
    const int num_inliers = 16 + static_cast<int>(seed % 10);
    const Pair pair =
        WithFocals(MakePair({.num_inliers = num_inliers, .num_outliers = 60}, seed), 1.0, false);
    const PairReport report = Verify(pair);
    if (report.status != PairStatus::kVerified) continue;
    ++num_verified;
    EXPECT_NE(report.geometry.config, TwoViewConfig::kCalibrated) << seed;
    if (report.geometry.config != TwoViewConfig::kUncalibrated) continue;
    EXPECT_TRUE(report.geometry.F.has_value());
    EXPECT_FALSE(report.geometry.E.has_value());
  }
  EXPECT_GE(num_verified, 20);
}

// A plane with `num_off` further points in front of it.
Pair MakePlaneAndMore(int num_on, int num_off, uint64_t seed) {
  const Rigid3d cam2_from_cam1(
      Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d(0.1, 1, 0.2).normalized())),
      Eigen::Vector3d(-1.0, 0.1, 0.3).normalized());
  Pair pair = MakePlanarPair(cam2_from_cam1, false, num_on, 0.3, seed);
  Rng rng(seed, "more");
  while (static_cast<int>(pair.matches.size()) < num_on + num_off) {
    const Eigen::Vector2d x1 = UniformVector({{-0.5, 0.5}, {-0.5, 0.5}}, rng);
    const Eigen::Vector3d X1 = rng.Uniform(1.5, 4.0) * x1.homogeneous();
    const Eigen::Vector3d X2 = cam2_from_cam1 * X1;
    if (X2.z() < 0.5 || (X2.head<2>() / X2.z()).cwiseAbs().maxCoeff() > 0.75) continue;
    const auto i = static_cast<point2D_t>(pair.matches.size());
    for (auto* keypoints : {&pair.keypoints1, &pair.keypoints2}) {
      const bool is_first = keypoints == &pair.keypoints1;
      const Eigen::Vector2d pixel =
          (is_first ? pair.camera1 : pair.camera2).ImgFromCam((is_first ? X1 : X2).hnormalized());
      keypoints->push_back(RoundKeypoint(pixel + 0.3 * GaussianVector<2>(rng)));
    }
    pair.matches.push_back({i, i});
    pair.is_inlier.push_back(true);
  }
  return pair;
}

// At a wrong focal length E explains little but a plane, and seems to see nothing else.
TEST(FocalVerifier, WhatAWrongFocalLengthSeesOfASceneIsNotItsPlane) {
  int num_trusted_planes = 0;
  for (const double factor : {0.4, 2.5}) {
    for (uint64_t seed = 0; seed < 5; ++seed) {
      Pair pair = MakePlaneAndMore(120, 120, seed);
      pair.camera1.SetMeanFocal(factor * pair.camera1.MeanFocal());
      num_trusted_planes += Verify(pair).geometry.config == TwoViewConfig::kPlanar;
      pair.camera1.has_prior_focal_length = false;
      const PairReport report = Verify(pair);
      ASSERT_EQ(report.status, PairStatus::kVerified) << seed;
      EXPECT_EQ(report.geometry.config, TwoViewConfig::kUncalibrated) << seed;
      EXPECT_LT(MedianErrorPx(pair, *report.geometry.F), 0.5) << seed;
    }
  }
  EXPECT_GE(num_trusted_planes, 2);
  // A plane is one, whatever is known of the focal lengths.
  Pair plane = MakePlaneAndMore(200, 0, 1);
  plane.camera1.has_prior_focal_length = false;
  EXPECT_EQ(Verify(plane).geometry.config, TwoViewConfig::kPlanar);
}

TEST(FocalVerifier, WrongPriorsAreNoticed) {
  int num_noticed = 0;
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const PairReport report = Verify(WithFocals(MakePair({.num_inliers = 300}, seed), 1.8, true));
    num_noticed += report.geometry.config == TwoViewConfig::kUncalibrated;
  }
  EXPECT_GE(num_noticed, 6);
}

TEST(FocalVerifier, TheShareDecidesWhatIsWrong) {
  const Pair pair = WithFocals(MakePair({.num_inliers = 300}, 3), 1.8, true);
  EXPECT_NE(Verify(pair, VerifierKind::kCascade, {.min_calibrated_share = 0.0}).geometry.config,
            TwoViewConfig::kUncalibrated);
}

TEST(FocalVerifier, UnrelatedImagesStayRejected) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const Pair pair =
        WithFocals(MakePair({.num_inliers = 0, .num_outliers = 300}, seed), 1.0, false);
    EXPECT_NE(Verify(pair).status, PairStatus::kVerified);
  }
}

// A rough wall, on which the affine frames of neighbours bear each other out.
TwoViewProblem MakeWall(TwoViewLayout layout, uint64_t seed) {
  TwoViewProblemOptions options;
  options.layout = layout;
  options.num_matches = 300;
  options.outlier_ratio = 0.3;
  options.noise.image_px = 0.3;
  TwoViewProblem problem = MakeTwoViewProblem(options, seed);
  problem.camera1.has_prior_focal_length = problem.camera2.has_prior_focal_length = true;
  return problem;
}

std::optional<FocalEvidence> Weigh(TwoViewProblem problem, double factor1, double factor2,
                                   VerifierKind kind = VerifierKind::kCascade) {
  problem.camera1.SetMeanFocal(factor1 * problem.camera1.MeanFocal());
  problem.camera2.SetMeanFocal(factor2 * problem.camera2.MeanFocal());
  PairInput input = InputByFrames(problem);
  input.weigh_focals = true;
  return MakePairVerifier(kind, {})->Verify(input).focal_evidence;
}

TEST(FocalEvidence, RightFocalLengthsExplainWhatAFundamentalMatrixDoes) {
  for (const VerifierKind kind :
       {VerifierKind::kCascade, VerifierKind::kFast, VerifierKind::kFivePoint}) {
    for (uint64_t seed = 0; seed < 5; ++seed) {
      const auto evidence = Weigh(MakeWall(TwoViewLayout::kRelief, seed), 1.0, 1.0, kind);
      ASSERT_TRUE(evidence.has_value()) << seed;
      EXPECT_GE(evidence->num_by_essential, 0.96 * evidence->num_by_fundamental) << seed;
      EXPECT_GE(evidence->num_by_essential, 0.9 * evidence->num_matches) << seed;
    }
  }
}

TEST(FocalEvidence, WrongFocalLengthsExplainLess) {
  int num_weighed = 0, num_less = 0;
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const TwoViewProblem wall = MakeWall(TwoViewLayout::kRelief, seed);
    for (const auto& [factor1, factor2] :
         {std::pair(2.0, 1.0), std::pair(0.5, 1.0), std::pair(1.0, 0.5), std::pair(0.4, 0.4)}) {
      const auto evidence = Weigh(wall, factor1, factor2);
      if (!evidence) continue;  // no pose
      ++num_weighed;
      EXPECT_GE(evidence->num_by_fundamental, 0.9 * evidence->num_matches) << seed;
      num_less += evidence->num_by_essential < 0.9 * evidence->num_by_fundamental;
    }
  }
  EXPECT_GE(num_weighed, 18);
  EXPECT_GE(num_less, 16);
}

// A plane is explained by any focal length: it does not contradict the right one.
TEST(FocalEvidence, APlaneContradictsNothing) {
  int num_weighed = 0;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const auto evidence = Weigh(MakeWall(TwoViewLayout::kPlane, seed), 1.0, 1.0);
    if (!evidence) continue;
    EXPECT_GE(evidence->num_by_essential, 0.96 * evidence->num_by_fundamental) << seed;
    ++num_weighed;
  }
  EXPECT_GE(num_weighed, 5) << num_weighed;
}

TEST(FocalEvidence, IsOfTrustedCamerasThatAskForIt) {
  TwoViewProblem wall = MakeWall(TwoViewLayout::kRelief, 1);
  wall.camera2.has_prior_focal_length = false;
  EXPECT_FALSE(Weigh(wall, 1.0, 1.0).has_value());
  EXPECT_FALSE(Verify(MakePair({.num_inliers = 200}, 1)).focal_evidence.has_value());
}

// 200 points of a wall, further right matches of things before it, and wrong ones.
Pair MakeNearPlanarPair(int num_right, uint64_t seed) {
  Rng rng(seed, "wall");
  Pair pair;
  pair.camera1 = MakeCamera(1, 1000.0, 0.0);
  pair.camera2 = MakeCamera(2, 1000.0, 0.0);
  const Eigen::Vector2d aside = UniformVector({{-0.3, 0.3}, {-0.3, 0.3}}, rng);
  pair.cam2_from_cam1 = Rigid3d(ExpSO3(RandomOfLength(0.1, 0.4, rng)),
                                Eigen::Vector3d(1.0, aside.x(), aside.y()).normalized());
  const Eigen::Vector3d normal = Eigen::Vector3d(rng.Uniform(-0.4, 0.4), 0.1, 1.0).normalized();
  constexpr int kNumOnWall = 200, kNumMatches = 300;
  constexpr double kNoisePx = 0.4;
  auto add = [&](const Eigen::Vector2d& pixel, std::vector<Keypoint>* keypoints) {
    keypoints->push_back(RoundKeypoint(pixel + kNoisePx * GaussianVector<2>(rng)));
  };
  while (static_cast<int>(pair.matches.size()) < kNumMatches) {
    const auto i = static_cast<point2D_t>(pair.matches.size());
    const Eigen::Vector3d ray = UniformVector({{-0.7, 0.7}, {-0.7, 0.7}}, rng).homogeneous();
    double depth = 5.0 / normal.dot(ray);
    if (i >= kNumOnWall) depth *= rng.Uniform(0.5, 0.9);
    const Eigen::Vector3d X2 = pair.cam2_from_cam1 * Eigen::Vector3d(depth * ray);
    if (X2.z() <= 0.5 || (X2.head<2>() / X2.z()).cwiseAbs().maxCoeff() > 0.75) continue;
    Eigen::Vector2d x2 = X2.hnormalized();
    if (static_cast<int>(i) >= num_right) x2 = {rng.Uniform(-0.75, 0.75), rng.Uniform(-0.75, 0.75)};
    add(pair.camera1.ImgFromCam(ray.head<2>()), &pair.keypoints1);
    add(pair.camera2.ImgFromCam(x2), &pair.keypoints2);
    pair.matches.push_back({i, i});
    pair.is_inlier.push_back(static_cast<int>(i) < num_right);
  }
  return pair;
}

// The guessed focal length bends E, and F from there stays at one of many that explain the wall.
TEST(FocalVerifier, DominantPlanesDoNotHoldTheFundamentalMatrix) {
  int num_good = 0;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const Pair pair = MakeNearPlanarPair(240, seed);
    const PairReport report = Verify(WithFocals(pair, 1.35, false));
    ASSERT_TRUE(report.geometry.F.has_value());
    EXPECT_EQ(report.geometry.config, TwoViewConfig::kUncalibrated);
    const Eigen::Matrix3d E = pair.camera2.CalibrationMatrix().transpose() * *report.geometry.F *
                              pair.camera1.CalibrationMatrix();
    double error = M_PI;
    for (const Rigid3d& pose : PosesFromEssential(NearestEssential(E))) {
      error = std::min(error, PoseError(pose, pair.cam2_from_cam1));
    }
    num_good += error < DegToRad(3.0);
  }
  EXPECT_GE(num_good, 19);
}

TEST(FocalVerifier, PlanesWithoutParallaxStayPlanar) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const PairReport report = Verify(WithFocals(MakeNearPlanarPair(200, seed), 1.35, false));
    ASSERT_EQ(report.status, PairStatus::kVerified);
    EXPECT_EQ(report.geometry.config, TwoViewConfig::kPlanar);
  }
}

// A camera that is given with 1.2 times the side of its images.
Camera MakePlainCamera(camera_t id, bool has_prior) {
  Camera camera = Camera::FromFocal(id, CameraModel::kSimplePinhole, 1200.0, 1000, 1000);
  camera.has_prior_focal_length = has_prior;
  return camera;
}

// F of points that were normalized by `factor` times the right focal lengths.
Eigen::Matrix3d Scaled(const Eigen::Matrix3d& E, double factor1, double factor2) {
  return Eigen::Vector3d(factor2, factor2, 1.0).asDiagonal() * E *
         Eigen::Vector3d(factor1, factor1, 1.0).asDiagonal();
}

Eigen::Matrix3d RandomEssential(Rng& rng) {
  const Eigen::Vector3d translation = RandomDirection(rng);
  return EssentialFromPose(Rigid3d(ExpSO3(RandomOfLength(0.1, 0.6, rng)), translation));
}

TEST(PlausibleFocals, AreThoseOfLensesOrNearWhatIsTrusted) {
  Rng rng(3);
  const Camera one = MakePlainCamera(1, true), other = MakePlainCamera(2, true);
  const Camera unknown = MakePlainCamera(3, false), unknown2 = MakePlainCamera(4, false);
  const Camera nameless = MakePlainCamera(kInvalidCameraId, false), nameless2 = nameless;
  int num_by_one_focal = 0, num_by_one_object = 0;
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Matrix3d E = RandomEssential(rng);
    EXPECT_TRUE(internal::HasPlausibleFocals(E, one, one));
    EXPECT_TRUE(internal::HasPlausibleFocals(Scaled(E, 0.5, 0.5), one, one));
    EXPECT_TRUE(internal::HasPlausibleFocals(Scaled(E, 2.0, 2.0), one, one));
    EXPECT_TRUE(internal::HasPlausibleFocals(Scaled(E, 0.5, 2.0), one, other));
    EXPECT_TRUE(internal::HasPlausibleFocals(Scaled(E, 3.0, 3.0), unknown, unknown));
    EXPECT_TRUE(internal::HasPlausibleFocals(Scaled(E, 0.2, 0.2), unknown, unknown));
    const Eigen::Matrix3d F = Scaled(E, 0.2, 3.0);
    EXPECT_TRUE(internal::HasPlausibleFocals(F, unknown, unknown2));
    EXPECT_TRUE(internal::HasPlausibleFocals(F, nameless, nameless2));
    num_by_one_focal += internal::HasPlausibleFocals(F, unknown, unknown);
    num_by_one_object += internal::HasPlausibleFocals(F, nameless, nameless);
  }
  EXPECT_LT(num_by_one_focal, 50);
  EXPECT_EQ(num_by_one_object, num_by_one_focal);
  // Singular values 2 and 1 at any focal lengths: forward motion, with pixels twice as wide.
  const Eigen::Matrix3d sideways = CrossMatrix(Eigen::Vector3d::UnitZ());
  const Eigen::Matrix3d F = Eigen::Vector3d(2.0, 1.0, 1.0).asDiagonal() * sideways;
  EXPECT_FALSE(internal::HasPlausibleFocals(F, one, one));
  EXPECT_FALSE(internal::HasPlausibleFocals(F, unknown, unknown2));
}

}  // namespace
}  // namespace cairn
