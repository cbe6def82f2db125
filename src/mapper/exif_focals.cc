#include <cmath>

#include "mapper/stages.h"

namespace cairn {

namespace {

bool AreFar(double focal1, double focal2, double sigma) {
  return std::abs(std::log(focal1 / focal2)) > 3 * sigma;
}

}  // namespace

std::set<image_t> ImagesThatLeftExif(const SceneData& scene, double exif_sigma,
                                     std::span<const Reconstruction> models) {
  std::set<image_t> left;
  size_t num_images = 0;
  for (const Reconstruction& model : models) {
    num_images += model.images.size();
    for (const auto& [id, image] : model.images) {
      const Camera& known = scene.CameraOf(id);
      if (!known.has_prior_focal_length || scene.constant_cameras.count(known.camera_id) > 0)
        continue;
      const double focal = model.cameras.at(image.image.camera_id).MeanFocal();
      const auto by_pairs = scene.exif_by_pairs.find(known.camera_id);
      const bool agrees_with_pairs =
          by_pairs != scene.exif_by_pairs.end() &&
          !AreFar(focal, by_pairs->second.focal_px, by_pairs->second.sigma);
      if (AreFar(focal, known.MeanFocal(), exif_sigma) && !agrees_with_pairs) left.insert(id);
    }
  }
  if (2 * left.size() <= num_images) left.clear();
  return left;
}

}  // namespace cairn
