#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "cairn/base/rng.h"
#include "cairn/camera/camera.h"
#include "cairn/database/database.h"
#include "cairn/math/so3.h"
#include "cairn/scene/reconstruction.h"
#include "cairn/synthetic/surface.h"
#include "math/random_vectors.h"

namespace cairn {

struct WideSceneOptions {
  int num_images = 10;
  int num_points = 900;  // on the walls, floor and ceiling of a room
  double field_deg = 180.0;
  double noise_px = 0.5;
  double outlier_ratio = 0.15;
};

// A room seen from within by a lens that sees far around: keypoints with affine frames and matches
// in `database`, taken by `camera`, of which the database may know something else. Returns the true
// poses.
inline Reconstruction WriteWideScene(const Camera& camera, const Camera& known_camera,
                                     const WideSceneOptions& options, uint64_t seed,
                                     Database& database) {
  Rng rng(seed, "wide scene");
  const Eigen::Vector3d half(5, 3, 4);
  std::vector<SurfaceElement> elements;
  for (int i = 0; i < options.num_points; ++i) {
    Eigen::Vector3d point = UniformVector({{-1, 1}, {-1, 1}, {-1, 1}}, rng);
    const int axis = static_cast<int>(rng.UniformInt(3));
    point[axis] = std::copysign(1.0, point[axis]);
    const Eigen::Vector3d normal = -point[axis] * Eigen::Vector3d::Unit(axis);
    const double angle = rng.Uniform(0, 6);
    const Eigen::Vector3d xyz = point.cwiseProduct(half) + 0.3 * rng.Uniform() * normal;
    elements.push_back(MakeSurfaceElement(xyz, normal, 0.02, angle));
  }
  Reconstruction truth;
  truth.cameras[camera.camera_id] = camera;
  Database::Transaction transaction(database);
  database.WriteCamera(known_camera);
  std::vector<std::vector<std::pair<int, point2D_t>>> seen(options.num_images);
  std::vector<size_t> num_keypoints;
  for (int i = 0; i < options.num_images; ++i) {
    const auto id = static_cast<image_t>(i + 1);
    const double angle = 2 * std::numbers::pi * i / options.num_images;
    const Eigen::Vector3d center(1.5 * std::cos(angle), rng.Uniform(-0.4, 0.4),
                                 1.5 * std::sin(angle));
    const Eigen::Vector2d tilt = UniformVector({{-0.2, 0.2}, {-0.3, 0.3}}, rng);
    const Eigen::Quaterniond rotation = ExpSO3({tilt.x(), 0.5 * angle, tilt.y()});
    RegisteredImage image;
    image.image = {id, "image" + std::to_string(id) + ".png", camera.camera_id};
    image.cam_from_world = Rigid3d(rotation, rotation * -center);
    const double min_cosine = std::cos(0.5 * options.field_deg * std::numbers::pi / 180.0);
    std::vector<Keypoint> keypoints;
    for (int k = 0; k < options.num_points; ++k) {
      const Eigen::Vector3d x = image.cam_from_world * elements[k].point;
      if (x.normalized().z() < min_cosine) continue;
      auto view = Observe(camera, image.cam_from_world, elements[k]);
      if (!view || !IsInImage(camera, view->pixel)) continue;
      view->pixel += options.noise_px * GaussianVector<2>(rng);
      seen[i].emplace_back(k, static_cast<point2D_t>(keypoints.size()));
      keypoints.push_back(view->ToKeypoint());
    }
    num_keypoints.push_back(keypoints.size());
    database.WriteImage(image.image);
    database.WriteKeypoints(id, keypoints);
    truth.images[id] = image;
  }
  for (int i = 0; i < options.num_images; ++i) {
    for (int j = i + 1; j < options.num_images; ++j) {
      FeatureMatches matches;
      size_t b = 0;
      for (const auto& [element, point1] : seen[i]) {
        while (b < seen[j].size() && seen[j][b].first < element) ++b;
        if (b == seen[j].size() || seen[j][b].first != element) continue;
        FeatureMatch match{point1, seen[j][b].second};
        if (rng.Uniform() < options.outlier_ratio) {
          match.point2 =
              static_cast<point2D_t>(rng.UniformInt(static_cast<uint32_t>(num_keypoints[j])));
        }
        matches.push_back(match);
      }
      if (matches.size() >= 20) {
        database.WriteMatches(
            ImagePairToPairId(static_cast<image_t>(i + 1), static_cast<image_t>(j + 1)), matches);
      }
    }
  }
  transaction.Commit();
  return truth;
}

}  // namespace cairn
