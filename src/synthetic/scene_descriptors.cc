#include <algorithm>
#include <array>
#include <cmath>

#include "cairn/base/rng.h"
#include "cairn/synthetic/scene.h"

namespace cairn {
namespace {

// Looks like SIFT: few large entries, many small ones, length about 512.
std::array<double, kDescriptorSize> MakePrototype(Rng rng) {
  std::array<double, kDescriptorSize> prototype;
  double squared_norm = 0;
  for (double& value : prototype) {
    value = -std::log(1.0 - rng.Uniform());
    squared_norm += value * value;
  }
  for (double& value : prototype) value *= 512.0 / std::sqrt(squared_norm);
  return prototype;
}

}  // namespace

Descriptors MakeDescriptors(const SyntheticScene& scene, image_t image_id) {
  const size_t num_keypoints = scene.keypoints.at(image_id).size();
  const auto registered = scene.truth.images.find(image_id);
  Rng rng(scene.seed, "scene_descriptors", image_id);
  Descriptors descriptors(num_keypoints, kDescriptorSize);
  for (size_t k = 0; k < num_keypoints; ++k) {
    point3D_t point = kInvalidPoint3DId;
    if (registered != scene.truth.images.end()) point = registered->second.point3D_ids[k];
    const uint64_t own_seed = rng.NextU64();
    const auto prototype =
        MakePrototype(point == kInvalidPoint3DId ? Rng(own_seed, "scene_clutter_descriptor")
                                                 : Rng(scene.seed, "scene_descriptor", point));
    for (int d = 0; d < kDescriptorSize; ++d) {
      const double value = std::round(prototype[d] + 6.0 * rng.Gaussian());
      descriptors(k, d) = static_cast<uint8_t>(std::clamp(value, 0.0, 255.0));
    }
  }
  return descriptors;
}

}  // namespace cairn
