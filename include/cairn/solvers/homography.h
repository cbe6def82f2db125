#pragma once

#include <Eigen/Core>
#include <span>

#include "cairn/geometry/rigid3d.h"
#include "cairn/solvers/point_correspondence.h"

namespace cairn {

// Homography x2 ~ H x1 from four correspondences, no three of them collinear. |H| = 1.
struct HomographyFourPoint {
  static constexpr int kSampleSize = 4;
  static constexpr int kMaxSolutions = 1;
  using Sample = PointCorrespondence;
  using Model = Eigen::Matrix3d;
  static int Solve(const Sample* samples, Model* models);
};

// Least squares over four or more (normalized direct linear transform; Hartley and Zisserman, 4.4).
bool HomographyFromPoints(std::span<const PointCorrespondence> samples, Eigen::Matrix3d* H);

// A camera motion with which a plane n^T X = d of view 1 induces a homography of normalized points:
// H ~ R + t n^T / d.
struct PlaneMotion {
  Rigid3d cam2_from_cam1;  // translation = t / d: not normalized
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
};

// The motions of a homography of normalized points (Ma, Soatto, Kosecka and Sastry, "An Invitation
// to 3-D Vision", 5.3.3): four for a plane (two opposite pairs, half of which put the points behind
// the camera), one with zero translation and normal when H is a rotation but for rounding. Returns
// the count; motions holds at least four.
int DecomposeHomography(const Eigen::Matrix3d& H, PlaneMotion* motions);

}  // namespace cairn
