#include "cairn/depth/sample_depth.h"

#include <algorithm>
#include <cmath>

#include "cairn/base/check.h"
#include "depth/weighted_planes.h"

namespace cairn {

std::vector<DepthSample> SampleDepth(const DepthMap& map, int image_width, int image_height,
                                     std::span<const Keypoint> keypoints,
                                     const DepthOptions& options) {
  CAIRN_CHECK(image_width > 0 && image_height > 0);
  const size_t num_pixels = static_cast<size_t>(map.width) * map.height;
  CAIRN_CHECK(num_pixels > 0 && map.values.size() == num_pixels);
  CAIRN_CHECK_EQ(map.is_valid.size(), num_pixels);

  const double scale_x =
      static_cast<double>(map.width) / image_width;  // map pixels per image pixel
  const double scale_y = static_cast<double>(map.height) / image_height;
  const double image_size = std::max(image_width, image_height);
  const auto make_planes = [&](double window) {
    return WeightedPlanes(map, window * image_size * scale_x, window * image_size * scale_y);
  };
  const WeightedPlanes value_planes = make_planes(options.value_window);
  const WeightedPlanes gradient_planes = make_planes(options.gradient_window);

  std::vector<DepthSample> samples(keypoints.size());
  for (size_t i = 0; i < keypoints.size(); ++i) {
    const double x = keypoints[i].x * scale_x, y = keypoints[i].y * scale_y;
    if (!(x >= 0 && x < map.width && y >= 0 && y < map.height)) continue;
    if (!map.is_valid[static_cast<size_t>(y) * map.width + static_cast<size_t>(x)]) continue;
    LocalPlane value, gradient;
    if (!value_planes.Fit(x, y, &value) || !gradient_planes.Fit(x, y, &gradient)) continue;
    const double depth = map.is_inverse ? 1.0 / value.value : value.value;
    const double ddepth_dvalue = map.is_inverse ? -depth * depth : 1.0;
    const DepthSample sample = {
        .depth = static_cast<float>(depth),
        .ddepth_dx = static_cast<float>(ddepth_dvalue * gradient.gradient_x * scale_x),
        .ddepth_dy = static_cast<float>(ddepth_dvalue * gradient.gradient_y * scale_y),
        .is_valid = depth > 0};
    const bool is_known = std::isnormal(sample.depth) && std::isfinite(sample.ddepth_dx) &&
                          std::isfinite(sample.ddepth_dy);
    if (is_known && sample.is_valid) samples[i] = sample;
  }
  return samples;
}

}  // namespace cairn
