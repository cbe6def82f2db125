#pragma once

#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "cairn/scene/reconstruction.h"
#include "math/random_vectors.h"

namespace cairn {

struct RandomReconstructionOptions {
  int num_images = 6;
  int num_points = 40;
  // One camera of each model in turn, with distortion and a shifted principal point; else one
  // RADIAL camera with a central principal point, which Bundler can express.
  bool all_camera_models = true;
  int num_models = 5;  // so many of them, by their ids
  double pixel_noise = 0.3;
};

// num_models 0: RADIAL.
inline Camera RandomCamera(camera_t id, int num_models, Rng& rng) {
  const bool any_model = num_models > 0;
  const CameraModel model =
      any_model ? *CameraModelFromId(static_cast<int>(id - 1) % num_models) : CameraModel::kRadial;
  Camera camera = Camera::FromFocal(id, model, rng.Uniform(700, 900), 800, 600);
  if (any_model) {
    for (const int i : camera.PrincipalPointIndices()) camera.params[i] += rng.Uniform(-9, 9);
    for (const int i : camera.FocalIndices()) camera.params[i] *= rng.Uniform(0.99, 1.01);
  }
  for (const int i : camera.DistortionIndices()) camera.params[i] += rng.Uniform(-0.02, 0.02);
  return camera;
}

// Cameras on a circle that look at points around the origin; keypoints are projections with noise,
// some of them without a point. Consistent (CheckConsistency).
inline Reconstruction RandomReconstruction(uint64_t seed,
                                           const RandomReconstructionOptions& options = {}) {
  Rng rng(seed, "random_reconstruction");
  Reconstruction r;
  for (int i = 1; i <= options.num_images; ++i) {
    const image_t id = static_cast<image_t>(i);
    const camera_t camera_id = options.all_camera_models ? id : 1;
    if (r.cameras.count(camera_id) == 0) {
      r.cameras[camera_id] =
          RandomCamera(camera_id, options.all_camera_models ? options.num_models : 0, rng);
    }
    const Eigen::Vector2d tilt = UniformVector({{-0.1, 0.1}, {-0.1, 0.1}}, rng);
    const Eigen::Quaterniond around = ExpSO3({tilt.x(), 6.0 * i / options.num_images, tilt.y()});
    RegisteredImage& image = r.images[id];
    image.image = {id, "folder/image " + std::to_string(i) + ".jpg", camera_id};
    image.cam_from_world = Rigid3d(around.normalized(), Eigen::Vector3d(0.1, -0.2, 5 + 0.1 * i));
  }
  for (int p = 0; p < options.num_points; ++p) {
    Point3D point;
    point.xyz << rng.Uniform(-1, 1), rng.Uniform(-1, 1), rng.Uniform(-1, 1);
    for (uint8_t& channel : point.color) channel = static_cast<uint8_t>(rng.UniformInt(256));
    for (auto& [id, image] : r.images) {
      if (point.track.size() >= 2 && rng.Uniform() < 0.3) continue;
      const Eigen::Vector3d x = image.cam_from_world * point.xyz;
      const Eigen::Vector2d noise = GaussianVector<2>(rng);
      image.points2D.push_back(r.CameraOf(image).ImgFromCam(x.head<2>() / x.z()) +
                               options.pixel_noise * noise);
      image.point3D_ids.push_back(kInvalidPoint3DId);
      point.track.push_back({id, static_cast<point2D_t>(image.points2D.size() - 1)});
    }
    r.AddPoint3D(point);
    auto& first = r.images.begin()->second;  // a keypoint without a point
    first.points2D.push_back(UniformVector({{0, 800}, {0, 600}}, rng));
    first.point3D_ids.push_back(kInvalidPoint3DId);
  }
  r.UpdatePointErrors();
  return r;
}

}  // namespace cairn
