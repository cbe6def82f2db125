#pragma once

#include <cmath>
#include <map>
#include <set>
#include <vector>

#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {

// Twelve images of one camera.
inline SyntheticScene SceneOfOneCamera() {
  SceneOptions options = SmallScene();
  options.num_images = 12;
  options.num_cameras = 1;
  return MakeScene(options, 3);
}

// A camera for each image, of the scene's focal length times a factor, with nothing known.
inline Database WithACameraEach(const SyntheticScene& scene, double factor,
                                bool has_prior = false) {
  Database database = MakeDatabase(scene);
  for (Image image : scene.images) {
    Camera camera = scene.cameras.at(image.camera_id);
    camera.camera_id = 100 + image.image_id;
    camera.SetMeanFocal(factor * camera.MeanFocal());
    camera.has_prior_focal_length = has_prior;
    database.WriteCamera(camera);
    image.camera_id = camera.camera_id;
    database.WriteImage(image);
  }
  return database;
}

inline std::set<std::vector<double>> IntrinsicsOf(const Reconstruction& model) {
  std::set<std::vector<double>> intrinsics;
  for (const auto& [id, camera] : model.cameras) intrinsics.insert(camera.params);
  return intrinsics;
}

// Moves an image's keypoints as if it were zoomed.
inline void Zoom(const SyntheticScene& scene, image_t id, double factor, Database& database) {
  const Eigen::Vector2d center = scene.cameras.at(1).PrincipalPoint();
  MoveKeypoints(scene, id, database, [&](const Eigen::Vector2d& pixel) {
    return (center + factor * (pixel - center)).eval();
  });
}

// Every image by some percent of its own. Factors.
inline std::map<image_t, double> ZoomEach(const SyntheticScene& scene, Database& database) {
  std::map<image_t, double> zoom;
  for (const Image& image : scene.images) {
    zoom[image.image_id] = 1 + 0.08 * std::sin(5.0 * image.image_id);
    Zoom(scene, image.image_id, zoom[image.image_id], database);
  }
  return zoom;
}

}  // namespace cairn
