#pragma once

#include "cairn/base/rng.h"
#include "cairn/bundle_adjustment/bundle_adjustment.h"
#include "cairn/math/so3.h"
#include "math/random_vectors.h"

namespace cairn {

inline BundleAdjustmentOptions Precise() {
  BundleAdjustmentOptions options;
  options.max_iterations = 200;
  options.function_tolerance = 1e-12;
  return options;
}

struct Perturbation {
  double rotation = 0.02;  // radians
  double position = 0.1;
  double point = 0.1;
  double focal = 0;  // relative
};

inline Reconstruction Perturbed(const Reconstruction& truth, const Perturbation& by) {
  Rng rng(7);
  const auto random = [&](double size) { return Eigen::Vector3d(size * GaussianVector<3>(rng)); };
  Reconstruction model = truth;
  for (auto& [id, image] : model.images) {
    const Eigen::Vector3d center = image.cam_from_world.Center() + random(by.position);
    image.cam_from_world.rotation = ExpSO3(random(by.rotation)) * image.cam_from_world.rotation;
    image.cam_from_world.translation = image.cam_from_world.rotation * -center;
  }
  for (auto& [id, point] : model.points3D) point.xyz += random(by.point);
  for (auto& [id, camera] : model.cameras) {
    camera.SetMeanFocal(camera.MeanFocal() * (1 + by.focal * rng.Uniform(-1, 1)));
  }
  return model;
}

}  // namespace cairn
