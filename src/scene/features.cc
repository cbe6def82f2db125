#include "cairn/scene/features.h"

#include <cmath>

namespace cairn {

Keypoint Keypoint::FromScaleOrientation(float x, float y, float scale, float orientation) {
  const float c = scale * std::cos(orientation);
  const float s = scale * std::sin(orientation);
  return {x, y, c, -s, s, c};
}

DepthSample ShiftInverseDepth(const DepthSample& sample, double shift) {
  if (!sample.is_valid && !(sample.depth < 0)) return sample;
  const double factor =
      1.0 / (1.0 + shift * sample.depth);  // 1 / (1 / depth + shift) = factor depth
  DepthSample shifted;
  shifted.depth = static_cast<float>(factor * sample.depth);
  shifted.ddepth_dx = static_cast<float>(factor * factor * sample.ddepth_dx);
  shifted.ddepth_dy = static_cast<float>(factor * factor * sample.ddepth_dy);
  shifted.is_valid = shifted.depth > 0 && std::isfinite(shifted.depth);
  return shifted;
}

}  // namespace cairn
