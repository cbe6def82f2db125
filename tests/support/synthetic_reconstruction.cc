#include "support/synthetic_reconstruction.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "cairn/base/rng.h"
#include "cairn/evaluation/alignment.h"
#include "cairn/math/so3.h"
#include "math/random_vectors.h"

namespace cairn {
namespace {

Camera MakeCamera(camera_t id, const SyntheticOptions& options, Rng& rng) {
  Camera camera = Camera::FromFocal(id, options.model, 800 + 50.0 * id, 1000, 800);
  if (camera.FocalIndices().size() == 2) camera.params[1] *= 1.01;
  const std::vector<int> distortion = camera.DistortionIndices();
  const double values[4] = {-0.05, 0.01, 0.001, -0.0005};
  for (size_t i = 0; i < distortion.size(); ++i) {
    camera.params[distortion[i]] += values[i % 4] * rng.Uniform(0.8, 1.2);
  }
  if (options.model == CameraModel::kFov) camera.params[4] = 0.8;
  if (options.model == CameraModel::kEucm) camera.params[4] = 0.5;
  return camera;
}

}  // namespace

MadeReconstruction MakeSyntheticScene(const SyntheticOptions& options) {
  Rng rng(options.seed, "synthetic scene");
  MadeReconstruction scene;
  const auto random = [&](double size) {
    return Eigen::Vector3d(size * UniformVector({{-1, 1}, {-1, 1}, {-1, 1}}, rng));
  };
  for (int i = 0; i < options.num_images; ++i) {
    const camera_t camera_id = options.shared_camera ? 1 : static_cast<camera_t>(i + 1);
    if (scene.truth.cameras.count(camera_id) == 0) {
      scene.truth.cameras[camera_id] = MakeCamera(camera_id, options, rng);
    }
    RegisteredImage image;
    image.image.image_id = static_cast<image_t>(i + 1);
    image.image.name = "image" + std::to_string(i + 1);
    image.image.camera_id = camera_id;
    const double angle = 1.5 * (i / std::max(1.0, options.num_images - 1.0) - 0.5);
    const Eigen::Vector3d center =
        Eigen::Vector3d(8 * std::sin(angle), 0, -8 * std::cos(angle)) + random(0.5);
    const Eigen::Vector3d axis = (-center).cross(Eigen::Vector3d::UnitZ()).normalized();
    const Eigen::Quaterniond look =
        ExpSO3(random(0.05)) * ExpSO3(AngleBetween(-center, Eigen::Vector3d::UnitZ()) * axis);
    image.cam_from_world = Rigid3d(look, look * -center);
    scene.truth.images[image.image.image_id] = image;
  }
  for (int k = 0; k < options.num_points; ++k) {
    Point3D point;
    point.xyz = random(2);
    std::vector<std::pair<image_t, Eigen::Vector2d>> seen;
    for (const auto& [image_id, image] : scene.truth.images) {
      const Camera& camera = scene.truth.CameraOf(image);
      Eigen::Vector2d pixel = camera.ImgFromCam((image.cam_from_world * point.xyz).hnormalized());
      pixel += options.noise_px * GaussianVector<2>(rng);
      const bool visible = rng.Uniform() < options.visible_share;
      if (rng.Uniform() < options.outlier_share) {
        const double direction = rng.Uniform(0, 6.28);
        pixel += rng.Uniform(20, 200) * Eigen::Vector2d(std::cos(direction), std::sin(direction));
      }
      if (visible) seen.emplace_back(image_id, pixel);
    }
    if (seen.size() < 2) continue;
    for (const auto& [image_id, pixel] : seen) {
      RegisteredImage& image = scene.truth.images.at(image_id);
      point.track.push_back({image_id, static_cast<point2D_t>(image.points2D.size())});
      image.points2D.push_back(pixel);
      image.point3D_ids.push_back(kInvalidPoint3DId);
    }
    scene.tracks.push_back(point.track);
    scene.truth.AddPoint3D(point);
  }
  return scene;
}

PoseDifference CompareAligned(const Reconstruction& estimate, const Reconstruction& truth) {
  std::vector<Eigen::Vector3d> src, dst;
  for (const auto& [image_id, image] : estimate.images) {
    src.push_back(image.cam_from_world.Center());
    dst.push_back(truth.images.at(image_id).cam_from_world.Center());
  }
  const Sim3d truth_from_estimate = AlignSimilarity(src, dst).value();
  PoseDifference difference;
  for (const auto& [image_id, image] : estimate.images) {
    const Rigid3d moved = TransformCameraWorld(truth_from_estimate, image.cam_from_world);
    const Rigid3d& expected = truth.images.at(image_id).cam_from_world;
    difference.center = std::max(difference.center, (moved.Center() - expected.Center()).norm());
    difference.angle = std::max(difference.angle, AngleBetween(moved.rotation, expected.rotation));
  }
  return difference;
}

}  // namespace cairn
