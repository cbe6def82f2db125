// A building with four equal facades, photographed from all around: images of different facades
// agree with each other as if they showed one.
#include <numbers>
#include <set>

#include "cairn/base/rng.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "math/random_vectors.h"
#include "support/test.h"
#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {
namespace {

constexpr int kSides = 4;

struct SymmetricOptions {
  int num_images = 24;
  int num_facade_points = 150;  // the same on every side
  int num_own_points = 80;      // of each side, like no others
  double focal_guess = 0;       // relative to the true one; 0: it is known
};

Eigen::Quaterniond Turn(double angle) { return ExpSO3({0, angle, 0}); }

// Points about a vertical axis, in photographs that look at it.
struct Building {
  Building() : camera(Camera::FromFocal(1, CameraModel::kSimplePinhole, 900, 1000, 800)) {
    camera.has_prior_focal_length = true;
  }

  void AddImage(const Eigen::Vector3d& center, const Eigen::Quaterniond& rotation, Rng& rng) {
    poses.emplace_back(rotation, Eigen::Vector3d(rotation * -center));
    const image_t id = static_cast<image_t>(poses.size());
    database.WriteImage({id, "image" + std::to_string(id) + ".jpg", 1});
    std::vector<Keypoint> keypoints;
    keypoint_of.emplace_back(points.size(), -1);
    for (size_t p = 0; p < points.size(); ++p) {
      const Eigen::Vector3d outward(points[p].x(), 0, points[p].z());
      const Eigen::Vector3d ray = points[p] - center;
      if (outward.normalized().dot(ray.normalized()) > -0.35) continue;  // from behind, or slanted
      const Eigen::Vector2d pixel = camera.ImgFromCam((poses.back() * points[p]).hnormalized());
      if ((pixel.array() < 0).any() || pixel.x() > camera.width || pixel.y() > camera.height) {
        continue;
      }
      keypoint_of.back()[p] = static_cast<int>(keypoints.size());
      Keypoint keypoint;
      keypoint.x = static_cast<float>(pixel.x() + 0.3 * rng.Gaussian());
      keypoint.y = static_cast<float>(pixel.y() + 0.3 * rng.Gaussian());
      keypoints.push_back(keypoint);
    }
    database.WriteKeypoints(id, keypoints);
  }

  // The largest error of the rotations of two images relative to each other.
  double LargestErrorDeg(const Reconstruction& model) const {
    double largest = 0;
    for (const auto& [id1, image1] : model.images) {
      for (const auto& [id2, image2] : model.images) {
        const Eigen::Quaterniond found =
            image2.cam_from_world.rotation * image1.cam_from_world.rotation.conjugate();
        const Eigen::Quaterniond truth =
            poses[id2 - 1].rotation * poses[id1 - 1].rotation.conjugate();
        largest = std::max(largest, RadToDeg(found.angularDistance(truth)));
      }
    }
    return largest;
  }

  Database database{":memory:"};
  Camera camera;
  std::vector<Eigen::Vector3d> points;
  std::vector<Rigid3d> poses;
  std::vector<std::vector<int>> keypoint_of;  // by image and point; -1: not seen
};

struct SymmetricBuilding : Building {
  SymmetricBuilding(const SymmetricOptions& options, uint64_t seed)
      : num_facade(options.num_facade_points) {
    Rng rng(seed);
    // On the first side, about the direction -z.
    const auto point = [&](double radius, double top, double bottom) {
      const double angle = rng.Uniform(-0.25, 0.25) * std::numbers::pi;
      return Eigen::Vector3d(radius * std::sin(angle), rng.Uniform(top, bottom),
                             -radius * std::cos(angle));
    };
    std::vector<Eigen::Vector3d> facade;
    for (int k = 0; k < num_facade; ++k) facade.push_back(point(rng.Uniform(0.9, 1.1), -0.9, 0.5));
    for (int side = 0; side < kSides; ++side) {
      const Eigen::Quaterniond turn = Turn(side * 0.5 * std::numbers::pi);
      for (const Eigen::Vector3d& x : facade) points.push_back(turn * x);
    }
    for (int side = 0; side < kSides; ++side) {
      const Eigen::Quaterniond turn = Turn(side * 0.5 * std::numbers::pi);
      for (int k = 0; k < options.num_own_points; ++k) {
        // What stands in front of it.
        points.push_back(turn * point(rng.Uniform(1.0, 1.6), 0.55, 1.0));
      }
    }
    Camera written = camera;
    if (options.focal_guess > 0) {
      written.has_prior_focal_length = false;
      written.SetMeanFocal(options.focal_guess * camera.MeanFocal());
    }
    database.WriteCamera(written);
    is_guess = options.focal_guess > 0;
    for (int i = 0; i < options.num_images; ++i) {
      AddImageAt(2 * std::numbers::pi * (i + rng.Uniform(-0.2, 0.2)) / options.num_images, rng);
    }
    for (size_t i = 0; i < poses.size(); ++i) {
      for (size_t j = i + 1; j < poses.size(); ++j) AddPair(i, j);
    }
  }

  void AddImageAt(double angle, Rng& rng) {
    const Eigen::Vector2d off = UniformVector({{-0.3, 0.3}, {-0.2, 0.2}}, rng);
    const Eigen::Vector3d center = Turn(angle) * Eigen::Vector3d(0, off.x(), -3.5 + off.y());
    const Eigen::Quaterniond rotation =
        ExpSO3({rng.Uniform(-0.03, 0.03), rng.Uniform(-0.03, 0.03), 0}) * Turn(angle).conjugate();
    AddImage(center, rotation, rng);
  }

  // The turn of the building under which the images have most in common.
  void AddPair(size_t i, size_t j) {
    TwoViewGeometry best;
    for (int turn = 0; turn < kSides; ++turn) {
      TwoViewGeometry geometry;
      for (size_t p = 0; p < points.size(); ++p) {
        const bool is_facade = p < static_cast<size_t>(kSides * num_facade);
        if (!is_facade && turn != 0) break;
        const size_t q =
            is_facade ? (p + static_cast<size_t>(turn * num_facade)) % (kSides * num_facade) : p;
        if (keypoint_of[i][p] < 0 || keypoint_of[j][q] < 0) continue;
        geometry.inlier_matches.push_back(
            {static_cast<point2D_t>(keypoint_of[i][p]), static_cast<point2D_t>(keypoint_of[j][q])});
      }
      if (geometry.inlier_matches.size() <= best.inlier_matches.size()) continue;
      best = geometry;
      const Rigid3d turned(Turn(turn * 0.5 * std::numbers::pi), Eigen::Vector3d::Zero());
      Rigid3d pose = poses[j] * turned * Inverse(poses[i]);
      if (pose.translation.norm() < 0.05) {
        best.inlier_matches.clear();
        continue;
      }
      pose.translation.normalize();
      best.cam2_from_cam1 = pose;
    }
    if (best.inlier_matches.size() < 30) return;
    best.config = TwoViewConfig::kCalibrated;
    best.E = EssentialFromPose(*best.cam2_from_cam1);
    if (is_guess) {
      const Eigen::Matrix3d K = camera.CalibrationMatrix();
      best.config = TwoViewConfig::kUncalibrated;
      best.F = FundamentalFromEssential(*best.E, K, K);
      best.E.reset();
      best.cam2_from_cam1.reset();
    }
    database.WriteTwoViewGeometry(
        ImagePairToPairId(static_cast<image_t>(i + 1), static_cast<image_t>(j + 1)), best);
    ++num_pairs;
    if (is_guess) return;
    const Eigen::Quaterniond truth = (poses[j] * Inverse(poses[i])).rotation;
    num_wrong += truth.angularDistance(best.cam2_from_cam1->rotation) > 0.1;
  }

  // Images of the model that do not agree with most of the others.
  int NumMisplaced(const Reconstruction& model) const {
    int most = 0;
    for (const auto& [id1, image1] : model.images) {
      int num_agreeing = 0;
      for (const auto& [id2, image2] : model.images) {
        const Eigen::Quaterniond found =
            image2.cam_from_world.rotation * image1.cam_from_world.rotation.conjugate();
        const Eigen::Quaterniond truth =
            poses[id2 - 1].rotation * poses[id1 - 1].rotation.conjugate();
        num_agreeing += RadToDeg(found.angularDistance(truth)) < 2;
      }
      most = std::max(most, num_agreeing);
    }
    return static_cast<int>(model.images.size()) - most;
  }

  // The points: facades, one after the other, then what is their own.
  int num_facade;
  int num_pairs = 0, num_wrong = 0;
  bool is_guess = false;
};

// One model of all sides, or one of each.
TEST(SymmetricBuilding, IsNotFoldedWhereTheSurroundingsTellTheSidesApart) {
  for (const uint64_t seed : {1, 2}) {
    const SymmetricBuilding building({.num_own_points = 200}, seed);
    EXPECT_GT(building.num_wrong, building.num_pairs / 2);
    const ReconstructResult result = Reconstruct(building.database);
    EXPECT_LE(result.models.size(), 4u);
    std::set<image_t> images;
    for (const Reconstruction& model : result.models) {
      EXPECT_LT(building.LargestErrorDeg(model), 1.0);
      for (const auto& [id, image] : model.images) {
        EXPECT_TRUE(images.insert(id).second) << "in two models";
      }
    }
    EXPECT_EQ(images.size(), 24u);
  }
}

// What nothing tells apart is written whole, and said to be doubtful.
TEST(SymmetricBuilding, IsDoubtedWhereNothingTellsTheSidesApart) {
  for (const uint64_t seed : {1, 2}) {
    for (const int num_own_points : {0, 20}) {
      const SymmetricBuilding building({.num_own_points = num_own_points}, seed);
      const ReconstructResult result = Reconstruct(building.database);
      EXPECT_TRUE(result.report.Succeeded());
      ASSERT_FALSE(result.models.empty());
      EXPECT_THAT(
          result.report.warnings,
          Contains(testing::Field(&ResultWarning::what,
                                  AllOf(HasSubstr("looks the same when turned by 90 degrees"),
                                        HasSubstr("image4.jpg")))));
      EXPECT_THAT(ToJson(result.report), HasSubstr("\"warnings\": ["));
    }
  }
}

// The same of cameras of which nothing is known: what is wrong is said, with the images.
TEST(SymmetricBuilding, IsDoubtedOfUnknownCamerasToo) {
  const SymmetricBuilding building({.num_own_points = 0, .focal_guess = 1.33}, 1);
  const ReconstructResult result = Reconstruct(building.database);
  EXPECT_TRUE(result.report.Succeeded());
  ASSERT_FALSE(result.models.empty());
  EXPECT_GT(building.LargestErrorDeg(result.models.front()), 45.0);
  ASSERT_FALSE(result.report.warnings.empty()) << ToJson(result.report);
  EXPECT_THAT(result.report.warnings[0].what, HasSubstr("images): "));
  EXPECT_THAT(result.report.warnings[0].what, HasSubstr(".jpg"));
}

TEST(SymmetricBuilding, IsNotFoldedWhereSomeSurroundingsDiffer) {
  for (const int num_own_points : {80, 120}) {
    int num_misplaced = 0;
    for (const uint64_t seed : {1, 2, 3, 4}) {
      const SymmetricBuilding building({.num_own_points = num_own_points}, seed);
      const ReconstructResult result = Reconstruct(building.database);
      EXPECT_EQ(result.models.size(), 4u) << num_own_points << " " << seed;
      for (const Reconstruction& model : result.models) {
        num_misplaced += building.NumMisplaced(model);
      }
    }
    // Of 96; one that sees two sides by halves.
    EXPECT_LE(num_misplaced, 1) << num_own_points;
  }
}

TEST(SymmetricBuilding, IsNeverFoldedWithoutAWord) {
  int num_folded = 0;
  for (const uint64_t seed : {1, 2, 3, 4}) {
    const SymmetricBuilding building({.num_own_points = 40}, seed);
    const ReconstructResult result = Reconstruct(building.database);
    EXPECT_FALSE(result.models.empty());
    for (const Reconstruction& model : result.models) {
      if (building.LargestErrorDeg(model) < 2.0) continue;
      ++num_folded;
      EXPECT_THAT(result.report.warnings,
                  Contains(::testing::Field(&ResultWarning::what, HasSubstr("looks the same"))));
    }
  }
  EXPECT_GE(num_folded, 2) << "the test has nothing to judge";
}

// A tower whose two sides look alike in part. Photographs of the one match those of the other
// there, more often than the few photographs of both.
struct Tower : Building {
  static constexpr int kSidePoints = 300;
  static constexpr int kAlike = 50;  // of each side
  static constexpr double kQuarter = std::numbers::pi / 2;

  Tower() {
    for (int side = 0; side < 2; ++side) {
      for (int k = 0; k < kSidePoints; ++k) {
        if (k < kAlike && side == 1) {
          points.emplace_back(Turn(kQuarter) * points[k]);
          continue;
        }
        const double angle = DegToRad(rng.Uniform(-45, 45));
        const double radius = rng.Uniform(0.9, 1.1);
        points.emplace_back(Turn(side * kQuarter) * Eigen::Vector3d(radius * std::sin(angle),
                                                                    rng.Uniform(-0.9, 0.7),
                                                                    -radius * std::cos(angle)));
      }
    }
    database.WriteCamera(camera);
    for (const double angle_deg : angles_deg) AddImageAt(angle_deg);
    for (size_t i = 0; i < poses.size(); ++i) {
      for (size_t j = i + 1; j < poses.size(); ++j) AddPair(i, j);
    }
  }

  void AddImageAt(double angle_deg) {
    const Eigen::Quaterniond turn = Turn(DegToRad(angle_deg));
    AddImage(turn * Eigen::Vector3d(0, rng.Uniform(-0.3, 0.3), -3.5), turn.conjugate(), rng);
  }

  void AddPair(size_t i, size_t j) {
    const bool is_across = angles_deg[i] < 50 && angles_deg[j] > 50;
    const bool sees_both = is_across && angles_deg[i] > 30;
    const bool looks_alike = is_across && !sees_both;
    const double turn_deg = angles_deg[j] - angles_deg[i] - (looks_alike ? 90 : 0);
    TwoViewGeometry geometry;
    for (size_t p = 0; p < points.size(); ++p) {
      if (looks_alike && p >= kAlike) break;
      if (sees_both && p % 10 != 0) continue;  // another light
      const int k1 = keypoint_of[i][p], k2 = keypoint_of[j][looks_alike ? p + kSidePoints : p];
      if (k1 < 0 || k2 < 0) continue;
      geometry.inlier_matches.push_back({static_cast<point2D_t>(k1), static_cast<point2D_t>(k2)});
    }
    const image_pair_t pair =
        ImagePairToPairId(static_cast<image_t>(i + 1), static_cast<image_t>(j + 1));
    if (geometry.inlier_matches.size() < 15 || (looks_alike && std::abs(turn_deg) > 5.5)) {
      database.WriteTwoViewGeometry(pair, {});
      return;
    }
    const Rigid3d turned(Turn(looks_alike ? kQuarter : 0), Eigen::Vector3d::Zero());
    geometry.cam2_from_cam1 = poses[j] * turned * Inverse(poses[i]);
    geometry.cam2_from_cam1->translation.normalize();
    geometry.config = TwoViewConfig::kCalibrated;
    geometry.E = EssentialFromPose(*geometry.cam2_from_cam1);
    database.WriteTwoViewGeometry(pair, geometry);
  }

  Rng rng{1};
  // Of the one side, both, and the other.
  std::vector<double> angles_deg = {-25, -20, -15, -10, -5, 0,  5,  10,
                                    15,  20,  35,  45,  84, 90, 96, 102};
};

TEST(LooseGroup, IsPlacedWhereOtherPairsPutIt) {
  const Tower tower;
  const ReconstructResult result = Reconstruct(tower.database);
  ASSERT_EQ(result.models.size(), 1u);
  EXPECT_EQ(result.models.front().images.size(), 16u);
  EXPECT_LT(tower.LargestErrorDeg(result.models.front()), 2.0) << ToJson(result.report);
}

}  // namespace
}  // namespace cairn
