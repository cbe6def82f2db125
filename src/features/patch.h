#pragma once

#include <Eigen/Core>
#include <array>

#include "cairn/scene/features.h"
#include "features/scale_space.h"

namespace cairn {

// The gradient of an image on a grid in the units of a local frame, whose axes are as long as its
// scale: 32 x 32 points 0.5 apart, which is SIFT's window of 4 x 4 cells of 3 units with half a
// cell around it. Zero on the border of the grid.
struct PatchGradient {
  static constexpr int kSide = 32;
  static constexpr float kStep = 0.5f;
  // The coordinate of a row or column, in units.
  static constexpr float At(int i) { return kStep * (static_cast<float>(i) - 0.5f * (kSide - 1)); }

  alignas(64) float x[kSide * kSide];
  alignas(64) float y[kSide * kSide];
};

// Between two planes of equal size: (1 - share_above) below + share_above above. The frame's center
// and its axes (columns of M) are in their pixels. Beyond their border they go on as they end
// there.
PatchGradient SampleGradient(const Plane& below, const Plane& above, double share_above,
                             const Eigen::Vector2d& center, const Eigen::Matrix2d& M);

// Sum of weight * g g^T; the weight is a Gaussian of 3 units, as wide as a cell of SIFT.
Eigen::Matrix2d SecondMoments(const PatchGradient& gradient);

// Sums of weight * |g| over bins of 10 degrees, from the first axis to the second; the weight is a
// Gaussian of 1.5 units (Lowe, IJCV 2004, section 5).
inline constexpr int kNumAngles = 36;
std::array<float, kNumAngles> AngleHistogram(const PatchGradient& gradient);

// SIFT's histogram (Lowe, IJCV 2004, section 6): 4 x 4 cells, row by row, of 8 angles from the
// first axis against the second, as in Lowe's binaries and COLMAP; linear in both, under a Gaussian
// of 6 units. Divided by its norm, then cut off at 0.2.
std::array<float, kDescriptorSize> SiftHistogram(const PatchGradient& gradient);

}  // namespace cairn
