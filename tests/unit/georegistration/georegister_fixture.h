#pragma once

#include <Eigen/Geometry>
#include <map>
#include <set>
#include <string>

#include "cairn/base/rng.h"
#include "cairn/georegistration/georegister.h"
#include "math/random_vectors.h"
#include "support/gps_at.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"

namespace cairn {

inline const LocalFrame kFrame({46.2, 7.1, 1200});

inline GpsPosition GpsAt(const Eigen::Vector3d& enu) { return GpsAt(kFrame, enu); }

// A model of 40 images in a frame of its own, and the positions of its cameras in east, north, up.
class GeoregisterTest : public ::testing::Test {
 protected:
  void SetUp() override {
    model_ = MakeSyntheticScene({.num_images = 40, .num_points = 10}).truth;
    Rng rng(3);
    for (auto& [id, image] : model_.images) {
      Eigen::Vector3d enu = UniformVector({{-300, 300}, {-200, 200}, {40, 90}}, rng);
      Place(id, enu);
      rows_[image.image.name].position = GpsAt(enu);
    }
    truth_ = Inverse(world_from_enu_);
  }
  // Gives the image's camera this center.
  void Place(image_t id, const Eigen::Vector3d& enu) {
    enu_[id] = enu;
    Rigid3d& pose = model_.images.at(id).cam_from_world;
    pose.translation = -(pose.rotation * (world_from_enu_ * enu));
  }
  void AddNoise(double sigma_m) {
    Rng rng(5);
    for (const auto& [id, enu] : enu_) {
      const Eigen::Vector3d noise = GaussianVector<3>(rng);
      rows_[model_.images.at(id).image.name].position = GpsAt(enu + sigma_m * noise);
    }
  }
  // Moves every fifth position by some hundred meters; returns which.
  std::set<std::string> MakeEveryFifthWrong() {
    std::set<std::string> wrong;
    Rng rng(9);
    for (const auto& [id, enu] : enu_) {
      if (id % 5 != 0) continue;
      const std::string name = model_.images.at(id).image.name;
      const Eigen::Vector2d error = UniformVector({{20, 300}, {-300, 300}}, rng);
      rows_[name].position = GpsAt(enu + Eigen::Vector3d(error.x(), error.y(), 5));
      wrong.insert(name);
    }
    return wrong;
  }
  static std::set<std::string> WrongOf(const Georegistration& found) {
    std::set<std::string> names;
    for (const GeoregisteredImage& image : found.images) {
      if (image.is_wrong) names.insert(image.name);
    }
    return names;
  }
  // Largest distance of a camera, moved into the frame, from the truth, meters.
  double LargestError(const Georegistration& found) {
    Reconstruction moved = model_;
    moved.Transform(found.enu_from_world);
    const LocalFrame frame(found.origin);
    double largest = 0;
    for (const auto& [id, image] : moved.images) {
      largest = std::max(largest,
                         (image.cam_from_world.Center() - frame.FromGps(GpsAt(enu_[id]))).norm());
    }
    return largest;
  }

  const Sim3d world_from_enu_{.scale = 0.013,
                              .rotation = Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized(),
                              .translation = Eigen::Vector3d(3, -4, 5)};
  Sim3d truth_;
  Reconstruction model_;
  std::map<image_t, Eigen::Vector3d> enu_;
  std::map<std::string, GpsRow> rows_;
};

}  // namespace cairn
