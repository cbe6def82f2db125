#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "cairn/geometry/rigid3d.h"

namespace cairn {

// Camera pose from three points: minimal, up to four solutions.
// Persson and Nordberg, "Lambda Twist: An Accurate Fast Robust Perspective Three Point (P3P)
// Solver", ECCV 2018: the three quadrics in the depths are intersected through one real root of a
// cubic, which splits a quadric into two planes; each depth triple gives one pose.
struct P3pSample {
  Eigen::Vector3d ray;  // camera frame, unit length
  Eigen::Vector3d xyz;  // world
};

class P3pSolver {
 public:
  static constexpr int kSampleSize = 3;
  static constexpr int kMaxSolutions = 4;
  using Sample = P3pSample;
  using Model = Rigid3d;  // cam_from_world

  // Writes the poses with all three points in front of the camera; returns how many. Collinear or
  // coincident points give 0.
  int Solve(std::span<const Sample, kSampleSize> samples,
            std::span<Model, kMaxSolutions> models) const;
};

}  // namespace cairn
