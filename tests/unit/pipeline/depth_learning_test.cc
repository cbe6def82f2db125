// From depth maps of a wall to what verification learns about them, through the database.
#include "pipeline/depth_learning.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "cairn/base/rng.h"
#include "cairn/depth/sample_depth.h"
#include "cairn/math/so3.h"
#include "cairn/pipeline/pair_scheduler.h"
#include "pipeline/depth_choice.h"
#include "support/database_dump.h"
#include "support/temp_folder.h"
#include "support/test_monitor.h"

namespace cairn {
namespace {

constexpr int kWidth = 1200, kHeight = 900;
constexpr int kMapWidth = 120, kMapHeight = 90;
constexpr int kNumImages = 9;
constexpr int kNumPoints = 120;

// z = height(x, y) in the world, seen from around z = -4.
using Surface = std::function<double(double, double)>;

double Wall(double x, double y) { return 0.3 * x - 0.2 * y + 0.1 * std::sin(x) * std::sin(y); }
// The same with bumps of about a tenth of the image.
double RoughWall(double x, double y) {
  return Wall(x, y) + 0.08 * std::sin(9.0 * x) * std::cos(8.0 * y);
}

Rigid3d CamFromWorld(image_t id) {
  const double angle = 0.07 * (static_cast<double>(id) - 5.0);
  const Eigen::Matrix3d R =
      ExpSO3(Eigen::Vector3d(0.02 * (id % 3), angle, 0.03 * (id % 2))).toRotationMatrix();
  const Eigen::Vector3d center(4.0 * std::sin(angle), 0.15 * (id % 2), -4.0 * std::cos(angle));
  return Rigid3d(R, -R * center);
}

// z-depth of the surface on the ray of a pixel (secant steps).
double DepthAt(const Surface& surface, const Camera& camera, const Rigid3d& cam_from_world,
               const Eigen::Vector2d& pixel) {
  const Rigid3d world_from_cam = Inverse(cam_from_world);
  const Eigen::Vector3d ray = camera.CamFromImg(pixel)->homogeneous();
  const auto above = [&](double depth) {
    const Eigen::Vector3d X = world_from_cam * Eigen::Vector3d(depth * ray);
    return X.z() - surface(X.x(), X.y());
  };
  double a = 3.0, b = 5.0;
  for (int i = 0; i < 9 && std::abs(above(b)) > 1e-7; ++i) {
    const double next = b - above(b) * (b - a) / (above(b) - above(a));
    a = b;
    b = next;
  }
  return b;
}

struct MapErrors {
  double noise = 0.0;  // relative, of each pixel
  double shift = 0.0;  // share of the mean inverse depth that the map lacks (kind "inverse")
};

class DepthLearningTest : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return folder_ / name; }

  DepthMap MakeMap(const Surface& surface, image_t id, const MapErrors& errors) const {
    Rng rng(id, "map");
    std::vector<float> values;
    double sum = 0.0;
    for (int row = 0; row < kMapHeight; ++row) {
      for (int column = 0; column < kMapWidth; ++column) {
        const Eigen::Vector2d pixel((column + 0.5) * kWidth / kMapWidth,
                                    (row + 0.5) * kHeight / kMapHeight);
        const double depth = DepthAt(surface, camera_, CamFromWorld(id), pixel) *
                             (1.0 + errors.noise * rng.Gaussian());
        values.push_back(static_cast<float>(errors.shift == 0.0 ? depth : 1.0 / depth));
        sum += values.back();
      }
    }
    const double mean = sum / static_cast<double>(values.size());
    DepthOptions options;
    if (errors.shift != 0.0) {
      options.kind = "inverse";
      for (float& value : values) value -= static_cast<float>(errors.shift * mean);
    }
    return DepthMapFromValues(kMapWidth, kMapHeight, values, options);
  }

  // Keypoint k of every image is point k of the surface, with the frame that the surface has there.
  Keypoint Project(const Surface& surface, image_t id, double x, double y) const {
    const auto project = [&](double u, double v) {
      return camera_.ImgFromCam(
          (CamFromWorld(id) * Eigen::Vector3d(u, v, surface(u, v))).hnormalized());
    };
    constexpr double kStep = 1e-5, kSize = 0.02;
    const Eigen::Vector2d pixel = project(x, y);
    const Eigen::Vector2d a =
        (project(x + kStep, y) - project(x - kStep, y)) * (kSize / (2 * kStep));
    const Eigen::Vector2d b =
        (project(x, y + kStep) - project(x, y - kStep)) * (kSize / (2 * kStep));
    const auto f = [](double value) { return static_cast<float>(value); };
    return {f(pixel.x()), f(pixel.y()), f(a.x()), f(b.x()), f(a.y()), f(b.y())};
  }

  std::string MakeDatabase(const std::string& name, const Surface& surface, const MapErrors& errors,
                           const std::vector<DepthWindows>& scales) const {
    Database database(Path(name));
    Database::Transaction transaction(database);
    database.WriteCamera(camera_);
    FeatureMatches matches;
    for (point2D_t k = 0; k < kNumPoints; ++k) matches.push_back({k, k});
    for (image_t id = 1; id <= kNumImages; ++id) {
      database.WriteImage({id, "image" + std::to_string(id), 1});
      Rng rng(1, "points");
      std::vector<Keypoint> keypoints;
      for (int k = 0; k < kNumPoints; ++k) {
        const double x = rng.Uniform(-1.2, 1.2), y = rng.Uniform(-0.9, 0.9);
        keypoints.push_back(Project(surface, id, x, y));
      }
      database.WriteKeypoints(id, keypoints);
      const DepthMap map = MakeMap(surface, id, errors);
      std::vector<std::vector<DepthSample>> samples;
      for (const DepthWindows& windows : scales) {
        samples.push_back(SampleDepth(map, kWidth, kHeight, keypoints, windows));
      }
      database.WriteDepthScales(id, samples);
      for (image_t other = id + 1; other <= kNumImages; ++other) {
        database.WriteMatches(ImagePairToPairId(id, other), matches);
      }
    }
    transaction.Commit();
    return Path(name);
  }

  static VerificationReport Verify(const std::string& path, int num_threads = 2,
                                   ProgressMonitor& monitor = NullMonitor()) {
    Database database(path);
    VerificationInput input;
    input.options = "a = 1\n";
    return VerifyPairs(database, MakeVerifiers("fast", {}), input, {}, num_threads, monitor);
  }

  static std::map<image_t, ImageDepth> Learn(const std::string& path) {
    Verify(path);
    return Database(path).ReadImageDepth();
  }

  testing::TempFolder folder_;
  Camera camera_ = [] {
    Camera camera = Camera::FromFocal(1, CameraModel::kPinhole, 1300, kWidth, kHeight);
    camera.has_prior_focal_length = true;
    return camera;
  }();
};

constexpr DepthWindows kFine = {0.003, 0.01}, kMiddle = {0.026, 0.1}, kCoarse = {0.08, 0.3};

TEST_F(DepthLearningTest, NoisyMapsOfASmoothWallAreReadAtALargeScale) {
  const auto learned = Learn(MakeDatabase("a.db", Wall, {.noise = 0.1}, {kMiddle, kFine, kCoarse}));
  ASSERT_EQ(learned.size(), static_cast<size_t>(kNumImages));
  for (const auto& [id, depth] : learned) EXPECT_NE(depth.scale, 1) << id;
  const auto from_fine = Learn(MakeDatabase("b.db", Wall, {.noise = 0.1}, {kFine, kCoarse}));
  ASSERT_EQ(from_fine.size(), static_cast<size_t>(kNumImages));
  for (const auto& [id, depth] : from_fine) {
    EXPECT_EQ(depth.scale, 1) << id;
    EXPECT_EQ(depth.shift, 0.0) << id;
  }
}

TEST_F(DepthLearningTest, ExactMapsOfARoughWallAreReadAtASmallScale) {
  const auto learned = Learn(MakeDatabase("a.db", RoughWall, {}, {kMiddle, kFine, kCoarse}));
  ASSERT_EQ(learned.size(), static_cast<size_t>(kNumImages));
  for (const auto& [id, depth] : learned) {
    EXPECT_EQ(depth.scale, 1) << id;
    EXPECT_EQ(depth.shift, 0.0) << id;
    EXPECT_GT(DepthTrust(depth), 0.8) << id;
  }
}

TEST_F(DepthLearningTest, TheShiftOfInverseMapsIsFoundAndMakesHypothesesRight) {
  constexpr double kShift = 0.6;
  const std::string path =
      MakeDatabase("a.db", Wall, {.noise = 0.02, .shift = kShift}, {kMiddle, kFine, kCoarse});
  const auto learned = Learn(path);
  ASSERT_EQ(learned.size(), static_cast<size_t>(kNumImages));
  for (const auto& [id, depth] : learned) {
    const DepthMap map = MakeMap(Wall, id, {.noise = 0.02, .shift = kShift});
    double sum = 0.0;
    for (const float value : map.values) sum += value;
    const double mean = sum / static_cast<double>(map.values.size()) / (1.0 - kShift);
    EXPECT_NEAR(depth.shift / mean, kShift, 0.1) << id;
    EXPECT_GT(DepthTrust(depth), 0.6) << id;
  }
}

TEST_F(DepthLearningTest, RowsDoNotDependOnThreadsOrInterruptions) {
  const MapErrors errors = {.noise = 0.05, .shift = 0.3};
  const std::vector<DepthWindows> scales = {kFine, kCoarse};
  const std::string whole = MakeDatabase("1.db", Wall, errors, scales);
  Verify(whole, 1);
  const std::string dump = DumpDatabase(whole);
  EXPECT_NE(dump.find("\ncairn_image_depth: 1 "), std::string::npos);
  for (const int threads : {2, 8}) {
    const std::string path = MakeDatabase(std::to_string(threads) + ".db", Wall, errors, scales);
    Verify(path, threads);
    EXPECT_TRUE(DumpDatabase(path) == dump) << threads;
  }
  const std::string parts = MakeDatabase("parts.db", Wall, errors, scales);
  int num_runs = 0;
  for (; num_runs < 30; ++num_runs) {
    TestMonitor monitor(3);
    if (!StoppedEarly(Verify(parts, 2, monitor).stage)) break;
  }
  EXPECT_GT(num_runs, 4);
  EXPECT_TRUE(DumpDatabase(parts) == dump);
}

TEST_F(DepthLearningTest, DamagedAndMissingDepthTeachNothing) {
  const std::string path = MakeDatabase("a.db", Wall, {.noise = 0.1}, {kFine, kCoarse});
  {
    Database database(path);
    database.WriteDepthScales(2, {});
    database.WriteDepthScales(3, {std::vector<DepthSample>(7)});
  }
  const auto learned = Learn(path);
  EXPECT_GT(learned.size(), 4u);
  EXPECT_EQ(learned.count(2) + learned.count(3), 0u);
}

}  // namespace
}  // namespace cairn
