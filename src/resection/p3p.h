#pragma once

#include <Eigen/Core>

#include "cairn/geometry/rigid3d.h"

namespace cairn {

// Camera pose from three points: minimal, up to four solutions. The three law-of-cosines quadrics
// in the unknown distances give two homogeneous conics; one member of their pencil (a real root of
// a cubic) is a pair of lines, and each line meets a conic in up to two points (Persson and
// Nordberg, "Lambda Twist: An Accurate Fast Robust Perspective Three Point (P3P) Solver", ECCV
// 2018; Ding et al., "Revisiting the P3P Problem", CVPR 2023). Distances are polished by Newton's
// method.
struct P3pSample {
  Eigen::Vector3d ray;  // camera frame, unit length
  Eigen::Vector3d xyz;  // world
};

struct P3pSolver {
  static constexpr int kSampleSize = 3;
  static constexpr int kMaxSolutions = 4;
  using Sample = P3pSample;
  using Model = Rigid3d;  // cam_from_world

  // Writes the poses with all three points in front of the camera; returns how many. Collinear or
  // coincident points give 0.
  static int Solve(const Sample* samples, Model* models);
};

}  // namespace cairn
