#include "cairn/intrinsics/focal_calibration.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "cairn/synthetic/poses.h"
#include "support/test.h"
#include "unit/intrinsics/focal_rig.h"

namespace cairn {
namespace {

FocalCalibrationReport Calibrate(const std::map<camera_t, Camera>& cameras,
                                 const std::vector<FocalPair>& pairs,
                                 const FocalCalibrationOptions& options = {},
                                 const std::set<camera_t>& trusted = {}) {
  return CalibrateFocals(cameras, trusted, pairs, options);
}

// The matches and the matrix of a pair that has nothing to do with these images.
void Spoil(std::vector<FocalPair>& pairs, size_t every) {
  Rig other({700, 1900, 1100}, 9, 77);
  const std::vector<FocalPair> wrong = other.AllPairs();
  for (size_t i = 0; i < pairs.size(); i += every) {
    const FocalPair& replacement = wrong[i % wrong.size()];
    pairs[i].F = replacement.F;
    pairs[i].pixels1 = replacement.pixels1;
    pairs[i].pixels2 = replacement.pixels2;
  }
}

TEST(FocalCalibration, RecoversFocalLengthsWhereAFifthOfThePairsIsWrong) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    Rig rig({600, 700, 850, 1000, 1300}, 15, seed);
    std::vector<FocalPair> pairs = rig.AllPairs(0.3);
    Spoil(pairs, 5);
    const auto report = Calibrate(rig.Guesses(1200), pairs);
    ASSERT_EQ(report.cameras.size(), 5u);
    for (const auto& [id, focal] : report.cameras) {
      EXPECT_EQ(focal.status, FocalStatus::kCalibrated) << id;
      EXPECT_NEAR(focal.focal_px / rig.truth.at(id).MeanFocal(), 1.0, 0.01) << id;
      EXPECT_EQ(focal.focal_before_px, 1200);
      EXPECT_LT(std::abs(std::log(focal.focal_px / rig.truth.at(id).MeanFocal())), 4 * focal.sigma);
    }
    EXPECT_EQ(report.num_pairs, 105);
    EXPECT_NEAR(report.num_pairs_agreeing, 84, 12);
  }
}

TEST(FocalCalibration, ACameraOfItsOwnForEveryImage) {
  std::vector<double> focals;
  for (int i = 0; i < 10; ++i) focals.push_back(700 + 130 * i);
  Rig rig(focals, 10);
  const auto report = Calibrate(rig.Guesses(1200), rig.AllPairs());
  ASSERT_EQ(report.cameras.size(), 10u);
  for (const auto& [id, focal] : report.cameras) {
    EXPECT_EQ(focal.status, FocalStatus::kCalibrated) << id;
    EXPECT_NEAR(focal.focal_px / rig.truth.at(id).MeanFocal(), 1.0, 0.03) << id;
    EXPECT_EQ(focal.num_pairs, 9);
  }
}

TEST(FocalCalibration, OneCameraOfAllImages) {
  Rig rig({850}, 6);
  const auto report = Calibrate(rig.Guesses(1200), rig.AllPairs());
  EXPECT_NEAR(report.cameras.at(1).focal_px, 850, 8.5);
  EXPECT_EQ(report.cameras.at(1).status, FocalStatus::kCalibrated);
}

TEST(FocalCalibration, FindsWideAngleAndTelephotoLenses) {
  for (const double focal_px : {400.0, 3000.0, 6000.0}) {
    Rig rig({focal_px}, 12);
    const auto focal = Calibrate(rig.Guesses(1200), rig.AllPairs(0.2)).cameras.at(1);
    EXPECT_EQ(focal.status, FocalStatus::kCalibrated) << focal_px;
    EXPECT_NEAR(focal.focal_px / focal_px, 1.0, 0.1);
  }
  // Eight images of the longest are too few.
  Rig rig({6000}, 8);
  const auto few = Calibrate(rig.Guesses(1200), rig.AllPairs(0.2)).cameras.at(1);
  EXPECT_EQ(few.status, FocalStatus::kUndetermined);
  EXPECT_LT(few.sigma, 0.25);
}

TEST(FocalCalibration, ExactWithoutNoise) {
  Rig rig({850, 1500}, 6);
  const auto report = Calibrate(rig.Guesses(1200), rig.AllPairs(0));
  ASSERT_EQ(report.cameras.size(), 2u);
  for (const auto& [id, focal] : report.cameras) {
    EXPECT_NEAR(focal.focal_px / rig.truth.at(id).MeanFocal(), 1.0, 1e-3);
  }
}

TEST(FocalCalibration, ExifIsConfirmedOrOverruled) {
  Rig rig({1000}, 8);
  const std::vector<FocalPair> pairs = rig.AllPairs();
  const auto near = Calibrate(rig.Guesses(1040, true), pairs).cameras.at(1);
  EXPECT_EQ(near.status, FocalStatus::kConfirmed);
  const auto far = Calibrate(rig.Guesses(1500, true), pairs).cameras.at(1);
  EXPECT_EQ(far.status, FocalStatus::kCalibrated);
  EXPECT_NEAR(far.focal_px, 1000, 20);
}

TEST(FocalCalibration, TrustedCamerasAreKeptAndHelpTheOthers) {
  Rig rig({1000, 1600}, 6);
  std::map<camera_t, Camera> cameras = rig.Guesses(1200);
  cameras[1] = rig.truth.at(1);
  const auto report = Calibrate(cameras, rig.AllPairs(), {}, {1});
  ASSERT_EQ(report.cameras.size(), 1u);
  EXPECT_NEAR(report.cameras.at(2).focal_px, 1600, 16);
  EXPECT_TRUE(Calibrate(cameras, rig.AllPairs(), {}, {1, 2}).cameras.empty());
}

// Rotations alone, a plane, and parallel optical axes say nothing about focal lengths.
TEST(FocalCalibration, DegenerateMotionsAreRefused) {
  const auto refused = [](Rig& rig, const std::string& what) {
    const auto report = Calibrate(rig.Guesses(1200), rig.AllPairs());
    ASSERT_EQ(report.cameras.size(), 1u) << what;
    for (const auto& [id, focal] : report.cameras) {
      EXPECT_NE(focal.status, FocalStatus::kCalibrated)
          << what << ": " << focal.focal_px << " sigma " << focal.sigma;
    }
  };
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    Rig parallel({900}, 6, seed);
    for (size_t i = 0; i < parallel.poses.size(); ++i) {
      parallel.poses[i] =
          Rigid3d(Eigen::Quaterniond::Identity(), Eigen::Vector3d(0.3 * i, 0.1 * (i % 3), 4));
    }
    refused(parallel, "parallel axes");
    Rig rotations({900}, 6, seed);
    for (Rigid3d& pose : rotations.poses) {
      const Eigen::Vector2d small = UniformVector({{-0.1, 0.1}, {-0.1, 0.1}}, rotations.rng);
      pose = Rigid3d(ExpSO3({small.x(), small.y(), 0.1}), Eigen::Vector3d(0, 0, 4));
    }
    refused(rotations, "pure rotations");
    Rig plane({900}, 6, seed);
    for (Eigen::Vector3d& x : plane.points) x.z() = 0;
    for (size_t i = 0; i < plane.poses.size(); ++i) {
      // In front of it, so that it is not seen from the side.
      const Eigen::Vector3d axis(0.05 * static_cast<double>(i % 3), 0.1 * static_cast<double>(i),
                                 0);
      plane.poses[i] = Rigid3d(ExpSO3(axis), Eigen::Vector3d(0, 0, 4));
    }
    refused(plane, "plane");
  }
}

// Around an object, optical axes meet in one point at one distance: any focal length fits with some
// principal point, which all pairs share.
TEST(FocalCalibration, PrincipalPointsOfFixatingCamerasMisleadNobody) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Rig rig({1500}, 24, seed);
    for (size_t i = 0; i < rig.poses.size(); ++i) {
      // An arc of 120 degrees at two heights, 12 degrees apart.
      const double yaw = 2.1 / 24 * static_cast<double>(i),
                   pitch = 0.2 * static_cast<double>(i % 2);
      const Eigen::Quaterniond R = ExpSO3({pitch, 0, 0}) * ExpSO3({0, yaw, 0});
      rig.poses[i] = Rigid3d(R, Eigen::Vector3d(0, 0, 5));
    }
    std::vector<FocalPair> pairs = rig.AllPairs(0.2);
    const Eigen::Vector2d shift(15, 12);  // one and a half standard deviations
    const Eigen::Matrix3d to_shifted = Eigen::Affine2d(Eigen::Translation2d(-shift)).matrix();
    for (FocalPair& pair : pairs) {
      for (Eigen::Vector2d& x : pair.pixels1) x += shift;
      for (Eigen::Vector2d& x : pair.pixels2) x += shift;
      pair.F = to_shifted.transpose() * pair.F * to_shifted;
    }
    const CalibratedFocal focal = Calibrate(rig.Guesses(1200), pairs).cameras.at(1);
    EXPECT_LT(std::abs(std::log(focal.focal_px / 1500)), 3 * focal.sigma)
        << focal.focal_px << " sigma " << focal.sigma;
    EXPECT_EQ(focal.status, FocalStatus::kUndetermined);
  }
}

// Twelve images along a sixth of a circle, whose optical axes nearly meet. By how many standard
// deviations the focal length is off, over ten seeds, and the least and the largest deviation.
struct ArcResult {
  double worst = 0;
  double smallest_sigma = std::numeric_limits<double>::infinity();
  double largest_sigma = 0;
  double mean_error = 0;  // of the logarithm
};
ArcResult CalibrateArcs(double focal_px) {
  ArcResult result;
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Rig rig({focal_px}, 12, seed);
    const double distance = 1.1 * focal_px / (0.4 * kFocalTestHeight);
    for (int i = 0; i < 12; ++i) {
      const double angle = DegToRad(5.0 * i);
      const Eigen::Vector3d target =
          UniformVector({{-0.3, 0.3}, {-0.3, 0.3}, {-0.3, 0.3}}, rig.rng);
      const Eigen::Vector3d center(distance * std::sin(angle), 0.2 * distance,
                                   -distance * std::cos(angle));
      rig.poses[i] = Facing(center, target);
    }
    const CalibratedFocal focal = Calibrate(rig.Guesses(1200), rig.AllPairs()).cameras.at(1);
    const double error = std::log(focal.focal_px / focal_px);
    result.mean_error += error / 10;
    result.worst = std::max(result.worst, std::abs(error) / focal.sigma);
    result.smallest_sigma = std::min(result.smallest_sigma, focal.sigma);
    result.largest_sigma = std::max(result.largest_sigma, focal.sigma);
  }
  return result;
}

TEST(FocalCalibration, StandardDeviationsAreThoseOfTheErrors) {
  const ArcResult wide = CalibrateArcs(1000);
  EXPECT_LT(wide.worst, 3);
  EXPECT_LT(wide.smallest_sigma, 0.02);
  // Of a long lens, focal lengths far off cost hardly more, though the best one lies in a narrow
  // valley.
  const ArcResult tele = CalibrateArcs(3000);
  EXPECT_LT(tele.worst, 3);
  EXPECT_LT(tele.largest_sigma, 0.2);
}

// With weights that do not follow the focal length, noise makes it short: by 3 and 17 %.
TEST(FocalCalibration, LongLensesAreHardlyTooShort) {
  EXPECT_GT(CalibrateArcs(1800).mean_error, -0.02);
  EXPECT_GT(CalibrateArcs(3000).mean_error, -0.1);
}

TEST(FocalCalibration, PairsThatContradictEachOtherAreRefused) {
  Rig rig({1000}, 7);
  std::vector<FocalPair> pairs = rig.AllPairs();
  Spoil(pairs, 1);  // by pairs of cameras with very different focal lengths
  EXPECT_EQ(Calibrate(rig.Guesses(1200), pairs).cameras.at(1).status, FocalStatus::kContradicted);
}

TEST(FocalCalibration, ImplausibleFocalLengthsAreRefused) {
  Rig rig({900}, 6);
  const std::vector<FocalPair> pairs = rig.AllPairs();  // 58 degrees
  const auto status = [&](const FocalCalibrationOptions& options) {
    return Calibrate(rig.Guesses(1200), pairs, options).cameras.at(1).status;
  };
  EXPECT_EQ(status({.min_fov_deg = 55, .max_fov_deg = 61}), FocalStatus::kCalibrated);
  EXPECT_EQ(status({.min_fov_deg = 61}), FocalStatus::kImplausible);
  EXPECT_EQ(status({.max_fov_deg = 55}), FocalStatus::kImplausible);
}

TEST(FocalCalibration, OptionsDecideWhatIsBelieved) {
  Rig rig({900}, 8);
  const std::vector<FocalPair> pairs = rig.AllPairs();
  const auto run = [&](const FocalCalibrationOptions& options, double focal_px = 1200,
                       bool has_exif = false) {
    return Calibrate(rig.Guesses(focal_px, has_exif), pairs, options).cameras.at(1);
  };
  EXPECT_EQ(run({.min_pairs = 29}).status, FocalStatus::kTooFewPairs);
  EXPECT_EQ(run({.max_sigma = 1e-4}).status, FocalStatus::kUndetermined);
  EXPECT_GT(run({.guess_sigma = 0.1}).focal_px, run({}).focal_px + 0.1);
  EXPECT_GT(run({}, 1030, true).focal_px, run({.exif_sigma = 1}, 1030, true).focal_px + 0.1);
  EXPECT_EQ(run({}, 1030, true).status, FocalStatus::kConfirmed);
  EXPECT_EQ(run({.min_exif_error = 0}, 1030, true).status, FocalStatus::kCalibrated);
  EXPECT_GT(run({.principal_point_sigma = 0.05}).sigma, run({.principal_point_sigma = 0}).sigma);
}

TEST(FocalCalibration, TheSamePairsInAnotherOrderAndWithMoreThreads) {
  Rig rig({800, 1300}, 6);
  std::vector<FocalPair> pairs = rig.AllPairs();
  const auto one = CalibrateFocals(rig.Guesses(1200), {}, pairs, {}, {.num_threads = 1});
  const auto many = CalibrateFocals(rig.Guesses(1200), {}, pairs, {}, {.num_threads = 8});
  std::reverse(pairs.begin(), pairs.end());
  const auto reversed = CalibrateFocals(rig.Guesses(1200), {}, pairs, {}, {.num_threads = 1});
  ASSERT_EQ(one.cameras.size(), 2u);
  for (const auto& [id, focal] : one.cameras) {
    EXPECT_EQ(focal.focal_px, many.cameras.at(id).focal_px);
    EXPECT_NEAR(focal.focal_px, reversed.cameras.at(id).focal_px, 1e-2);
  }
}

TEST(FocalCalibration, NoPairsNoCameras) {
  EXPECT_TRUE(Calibrate({{1, GuessedCamera(1, 1000)}}, {}).cameras.empty());
}

TEST(FocalCalibration, RefusesCamerasThatHaveNoFundamentalMatrix) {
  Rig rig({850}, 3);
  const std::vector<FocalPair> pairs = rig.AllPairs();
  EXPECT_THROW(Calibrate({}, pairs), ConfigError);
  std::map<camera_t, Camera> cameras = rig.Guesses(1200);
  cameras[1].model = CameraModel::kEquirectangular;
  cameras[1].params = {kFocalTestWidth, kFocalTestHeight};
  EXPECT_THROW(Calibrate(cameras, pairs), ConfigError);
}

TEST(FocalCalibration, RefusesMeaninglessOptions) {
  EXPECT_THROW(CalibrateFocals({}, {}, {}, {.max_sigma = 0}), ConfigError);
}

TEST(SelectFocalPairs, TakesTheBestOfEveryCamera) {
  const std::vector<FocalPairCount> pairs = {{1, 2, 10}, {1, 3, 50}, {1, 4, 40}, {2, 3, 30}};
  EXPECT_THAT(SelectFocalPairs(pairs, 1), ElementsAre(1, 2, 3));
  EXPECT_THAT(SelectFocalPairs(pairs, 9), ElementsAre(0, 1, 2, 3));
  const std::vector<FocalPairCount> own = {{1, 1, 10}, {1, 1, 50}, {1, 1, 40}};
  EXPECT_THAT(SelectFocalPairs(own, 2), ElementsAre(1, 2));
}

// Kruppa's residuals are linear in the noise of F: by these alone, the focal lengths of rough pairs
// are 2.9 % too short here, not 1.9.
TEST(FocalCalibration, OfRoughPairsIsHardlyTooShort) {
  double mean = 0;
  constexpr int kNumSeeds = 10;
  for (int seed = 1; seed <= kNumSeeds; ++seed) {
    Rig rig({1500}, 10, seed);
    const auto report = Calibrate(rig.Guesses(1200), rig.AllPairs(5.0));
    mean += std::log(report.cameras.at(1).focal_px / 1500) / kNumSeeds;
  }
  EXPECT_NEAR(mean, 0, 0.024);
}

}  // namespace
}  // namespace cairn
