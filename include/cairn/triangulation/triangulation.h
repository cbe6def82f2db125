#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/geometry/rigid3d.h"

namespace cairn {

struct TriangulationOptions {
  // Largest reprojection error of an observation, pixels (times Camera::ErrorScale).
  double max_error_px = 4.0;
  // And in standard deviations of the observation, where its noise is known.
  double max_error_sigmas = 6.0;
  // Smallest angle that two rays of a point must reach, degrees.
  double min_angle_deg = 1.5;
  // Views that must agree with a point.
  int min_views = 2;
  // Gauss-Newton steps on the reprojection error of the agreeing views.
  int max_refinements = 5;
  // Pairs of views tried as hypotheses where not all views agree; 0 disables the search.
  int max_pairs = 50;

  void VisitFields(OptionVisitor& v);
};

// One observation: the camera's pose, the ray (u, v, 1) of the pixel with the distortion removed,
// the focal length (pixels) that turns differences of rays into pixels there, and the standard
// deviation of the pixel (0: not known, all alike).
struct TriangulationView {
  Eigen::Matrix3d cam_from_world_rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d cam_from_world_translation = Eigen::Vector3d::Zero();
  Eigen::Vector2d ray = Eigen::Vector2d::Zero();
  double focal_px = 1.0;
  double sigma_px = 0.0;
  double error_scale = 1.0;  // Camera::ErrorScale
};

enum class TriangulationStatus : int {
  kSuccess = 0,
  kTooFewViews,  // fewer views than min_views given, or agreeing with any hypothesis
  kSmallAngle,   // the agreeing rays are nearly parallel
  kIllPosed,     // no finite point: the rays are parallel
};

struct TriangulationResult {
  TriangulationStatus status = TriangulationStatus::kIllPosed;
  // The rest is filled when status is kSuccess.
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();  // world
  std::vector<int> inliers;                       // indices of the agreeing views, ascending
  double mean_error_px = 0;                       // over the inliers
};

// Robust triangulation: the point nearest to the rays of all views (midpoint method); where not all
// agree with it, from pairs of views, the one with the smallest truncated squared error wins.
// Refined by Gauss-Newton on the agreeing views; in front of all of them, within max_error_px, with
// min_angle_deg between two of them. Deterministic. Cost: microseconds, linear in views, times
// max_pairs where views disagree.
TriangulationResult Triangulate(std::span<const TriangulationView> views,
                                const TriangulationOptions& options);

// Largest angle (degrees) between the rays from the centers to the point; or the first one found of
// enough_deg and more: all pairs of a thousand centers take a millisecond.
double MaxTriangulationAngleDeg(const Eigen::Vector3d& xyz, std::vector<Eigen::Vector3d> centers,
                                double enough_deg = 180.0);

}  // namespace cairn
