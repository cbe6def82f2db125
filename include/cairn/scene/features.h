#pragma once

#include <Eigen/Core>
#include <cmath>
#include <compare>
#include <cstdint>
#include <vector>

#include "cairn/base/types.h"

namespace cairn {

// A local affine frame: position (x, y) in pixels (center of the top-left pixel is (0.5, 0.5)) and
// shape M = [a11 a12; a21 a22], whose columns are the frame's axes in pixels. COLMAP's six float
// columns, in order.
struct Keypoint {
  float x = 0, y = 0;
  float a11 = 1, a12 = 0, a21 = 0, a22 = 1;

  // The similarity frame scale * Rot(orientation), orientation in radians.
  static Keypoint FromScaleOrientation(float x, float y, float scale, float orientation) {
    const float c = scale * std::cos(orientation);
    const float s = scale * std::sin(orientation);
    return {x, y, c, -s, s, c};
  }

  Eigen::Vector2d Position() const { return {x, y}; }
  Eigen::Matrix2d Shape() const { return (Eigen::Matrix2d() << a11, a12, a21, a22).finished(); }
  bool operator==(const Keypoint&) const = default;
};
static_assert(sizeof(Keypoint) == 6 * sizeof(float));

// One row of kDescriptorSize (SIFT's) a keypoint.
inline constexpr int kDescriptorSize = 128;
using Descriptors = Eigen::Matrix<uint8_t, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// One value a keypoint: 1 where it is brighter inside than around, 0 where it is darker; the sign
// of the Laplacian (SURF: Bay et al., CVIU 2008). Empty: not known.
using Polarities = std::vector<uint8_t>;

// z-depth at a keypoint and its gradient per image pixel, in the depth map's own (unknown) unit.
// Where the map has no value, is_valid is false and the numbers are meaningless.
struct DepthSample {
  float depth = 0;
  float ddepth_dx = 0, ddepth_dy = 0;
  bool is_valid = false;
};

// Keypoint point1 of the first image corresponds to keypoint point2 of the second.
struct FeatureMatch {
  point2D_t point1 = 0;
  point2D_t point2 = 0;
  auto operator<=>(const FeatureMatch&) const = default;
};
using FeatureMatches = std::vector<FeatureMatch>;

}  // namespace cairn
