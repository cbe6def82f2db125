#include <algorithm>
#include <cmath>

#include "mapper/stages.h"

namespace cairn {
namespace {

bool AreFar(double focal1, double focal2, double sigma) {
  return std::abs(std::log(focal1 / focal2)) > kFarSigmas * sigma;
}

}  // namespace

bool RefinesExif(const Camera& camera, const SceneData& scene) {
  return camera.has_prior_focal_length && !scene.constant_cameras.contains(camera.camera_id);
}

std::set<image_t> ImagesThatLeftExif(const SceneData& scene, double exif_sigma,
                                     std::span<const Reconstruction> models) {
  std::set<image_t> left;
  for (const Reconstruction& model : models) {
    std::set<image_t> of_model;
    for (const auto& [id, image] : model.images) {
      const Camera& known = scene.CameraOf(id);
      if (!RefinesExif(known, scene)) continue;
      const double focal = model.cameras.at(image.image.camera_id).MeanFocal();
      const auto by_pairs = scene.focals_by_pairs.find(known.camera_id);
      double exif = known.MeanFocal();
      if (by_pairs != scene.focals_by_pairs.end() &&
          by_pairs->second.status == FocalStatus::kCalibrated) {
        const CalibratedFocal& found = by_pairs->second;
        exif = found.focal_before_px;
        if (!AreFar(focal, found.focal_px, found.sigma)) continue;
      }
      if (AreFar(focal, exif, exif_sigma)) of_model.insert(id);
    }
    if (2 * of_model.size() > model.images.size()) left.merge(of_model);
  }
  return left;
}

void HoldExif(const std::set<image_t>& images, double exif_sigma, double cost_nats,
              SceneData& scene) {
  const double usual_nats = 0.5 * kFarSigmas * kFarSigmas;
  const double sigma = exif_sigma * std::sqrt(usual_nats / std::max(cost_nats, usual_nats));
  for (const image_t id : images) scene.held_focals[scene.CameraIdOf(id)] = sigma;
  scene.origin += ", focal lengths held at EXIF's";
}

}  // namespace cairn
