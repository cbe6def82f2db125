#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/base/rng.h"
#include "cairn/camera/camera.h"
#include "cairn/geometry/rigid3d.h"

namespace cairn {

struct ResectionOptions {
  // Largest reprojection error of an inlier, pixels (times Camera::ErrorScale).
  double max_error_px = 8.0;
  // Inliers that a pose needs.
  int min_num_inliers = 15;
  // Share of the correspondences that must be inliers.
  double min_inlier_ratio = 0.2;
  int max_iterations = 5000;
  // Probability of having drawn one sample without outliers when the search stops.
  double confidence = 0.9999;
  // Where the focal length is only a guess, this many other lengths between a half and twice the
  // guess are tried as well, and the best is refined with the pose.
  int num_focal_guesses = 9;

  void VisitFields(OptionVisitor& v);
};

enum class ResectionStatus : int {
  kSuccess = 0,
  kTooFewPoints,   // fewer correspondences than min_num_inliers
  kNoModel,        // no sample gave a pose
  kTooFewInliers,  // fewer than min_num_inliers or min_inlier_ratio
};

struct ResectionReport {
  ResectionStatus status = ResectionStatus::kNoModel;
  // Filled when status is kSuccess.
  Rigid3d cam_from_world;
  Camera camera;             // as given, or with the focal length found
  std::vector<int> inliers;  // indices of the correspondences, ascending
  int num_iterations = 0;
};

// Pixels, and the world points that they show.
struct PixelsOfPoints {
  std::span<const Eigen::Vector2d> pixels;
  std::span<const Eigen::Vector3d> xyz;
};

// Pose of a camera from pixels that show known world points: P3P in LO-RANSAC (MSAC score), then
// Levenberg-Marquardt on the robust reprojection error. estimate_focal: the camera's focal length
// is only a guess. rng: every focal length tried begins with it as it is.
ResectionReport EstimateAbsolutePose(const Camera& camera, const PixelsOfPoints& points,
                                     bool estimate_focal, const ResectionOptions& options,
                                     const Rng& rng);

}  // namespace cairn
