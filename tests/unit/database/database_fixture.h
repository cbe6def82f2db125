#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "cairn/database/database.h"
#include "support/temp_folder.h"
#include "support/test.h"

namespace cairn {

namespace fs = std::filesystem;
class DatabaseTest : public ::testing::Test {
 protected:
  void TearDown() override {
    fs::permissions(folder_, fs::perms::owner_all, fs::perm_options::add);
  }
  std::string Path(const std::string& name = "scene.db") const { return folder_ / name; }

  TempFolder temp_;
  const fs::path folder_ = temp_.path();
};

inline Camera TestCamera(camera_t id = 1) {
  Camera camera = Camera::FromFocal(id, CameraModel::kOpenCV, 1234.5, 1536, 1024);
  camera.params[4] = 0.01;
  camera.has_prior_focal_length = true;
  return camera;
}

inline void WriteImages(Database& database, int num_images) {
  database.WriteCamera(TestCamera());
  for (int i = 1; i <= num_images; ++i) {
    database.WriteImage({static_cast<image_t>(i), "image" + std::to_string(i) + ".jpg", 1});
  }
}

inline std::vector<Keypoint> RandomKeypoints(int n, uint64_t seed) {
  Rng rng(seed);
  std::vector<Keypoint> keypoints(n);
  for (Keypoint& k : keypoints) {
    const auto number = [&] { return static_cast<float>(rng.Gaussian()); };
    k = {100 + number(), 100 + number(), number(), number(), number(), number()};
  }
  return keypoints;
}

inline TwoViewGeometry TestGeometry() {
  TwoViewGeometry geometry;
  geometry.config = TwoViewConfig::kCalibrated;
  geometry.cam2_from_cam1 =
      Rigid3d(Eigen::Quaterniond(0.9, 0.1, -0.2, 0.3).normalized(), {0.6, 0.0, -0.8});
  geometry.E = (Eigen::Matrix3d() << 1, 2, 3, 4, 5, 6, 7, 8, 10).finished();
  geometry.F = geometry.E->transpose();
  geometry.inlier_matches = {{1, 2}, {3, 4}, {5, 0}};
  return geometry;
}

}  // namespace cairn
