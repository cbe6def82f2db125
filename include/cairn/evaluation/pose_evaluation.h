#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "cairn/evaluation/error_statistics.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

// What an evaluation needs of a camera.
struct PosedCamera {
  Rigid3d cam_from_world;
  double focal_px = 0;  // mean of fx and fy; 0: unknown
  int width = 0;        // 0: unknown
};
// By image name.
using PosedCameras = std::map<std::string, PosedCamera>;
PosedCameras PosedCamerasOf(const Reconstruction& reconstruction);

// Errors of one image of the reference; absent values where it is not registered, or no alignment.
struct ImageErrors {
  std::string name;  // in the reference
  bool registered = false;
  std::optional<double> orientation_deg;
  std::optional<double> center;  // units of the reference
  std::optional<double> focal_relative;
};

inline constexpr std::array<double, 5> kAucThresholdsDeg = {1, 3, 5, 10, 20};

struct PoseEvaluation {
  int num_reference = 0;
  int num_registered = 0;  // images of the reference that the estimate has
  int num_extra = 0;       // images of the estimate that the reference does not have
  // Of the larger of relative rotation and translation-direction error over all pairs of reference
  // images (of more than 10,000 images, a random sample); a pair with an image that is not
  // registered counts as infinite. In [0, 1].
  std::array<double, 5> auc = {};
  // Medians over pairs of registered images; absent with fewer than two.
  std::optional<double> relative_rotation_median_deg;
  std::optional<double> relative_translation_median_deg;
  // Camera centers after a robust similarity alignment, in the reference's unit; absent with fewer
  // than three registered images. `extent` is the largest distance of a registered reference center
  // from their mean.
  std::optional<ErrorStatistics> center;
  std::optional<double> extent;
  // Orientations after the robust rotation alignment, degrees; absent with none registered.
  std::optional<ErrorStatistics> orientation_deg;
  // |f - f_ref| / f_ref, where both are known; a reference for another image size is scaled.
  std::optional<ErrorStatistics> focal_relative;
  std::vector<ImageErrors> images;  // sorted by name
};

// Compares camera poses. A reference name is looked up in the estimate as it is, else by the last
// part of its path, where one image of either alone has that and no counterpart of its name.
// Deterministic. Cost: quadratic in the number of images.
PoseEvaluation EvaluatePoses(const PosedCameras& estimate, const PosedCameras& reference);

// As a readable table.
std::string FormatPoseEvaluation(const PoseEvaluation& evaluation);
// As JSON, AUC in percent, absent values null: registered, gt, extra, auc@1 ... auc@20,
// rel_rot_med_deg, rel_trans_med_deg, center_{med,mean,std,med_rel},
// orientation_{med,mean,std}_deg, focal_rel_{med,mean,std}, and per image {name, registered,
// orientation_deg, center, focal_rel}.
std::string PoseEvaluationToJson(const PoseEvaluation& evaluation);

}  // namespace cairn
