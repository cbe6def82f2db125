#include "cairn/scene/features.h"

#include <cmath>

namespace cairn {

Keypoint Keypoint::FromScaleOrientation(float x, float y, float scale, float orientation) {
  const float c = scale * std::cos(orientation);
  const float s = scale * std::sin(orientation);
  return {x, y, c, -s, s, c};
}

}  // namespace cairn
