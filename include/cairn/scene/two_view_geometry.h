#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>

#include "cairn/camera/camera.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/scene/features.h"

namespace cairn {

// COLMAP's `config` column.
enum class TwoViewConfig : int {
  kUndefined = 0,
  kDegenerate = 1,
  kCalibrated = 2,
  kUncalibrated = 3,
  kPlanar = 4,
  kPanoramic = 5,
  kPlanarOrPanoramic = 6,
  kWatermark = 7,
  kMultiple = 8,
};

std::string_view TwoViewConfigName(TwoViewConfig config);

// What verification found between image 1 and image 2, image_id1 < image_id2.
struct TwoViewGeometry {
  TwoViewConfig config = TwoViewConfig::kUndefined;
  // x_2 = R x_1 + t, |t| = 1 (t = 0 for a pure rotation). Absent where no pose is known.
  std::optional<Rigid3d> cam2_from_cam1;
  std::optional<Eigen::Matrix3d> E;  // x2^T E x1 = 0, normalized points.
  // For pixels freed from what the cameras know of distortion.
  std::optional<Eigen::Matrix3d> F;  // x2^T F x1 = 0
  std::optional<Eigen::Matrix3d> H;  // x2 ~ H x1
  FeatureMatches inlier_matches;
};

// E, or what F is for planar cameras; absent where neither is finite and not zero.
std::optional<Eigen::Matrix3d> EssentialOf(const TwoViewGeometry& geometry, const Camera& camera1,
                                           const Camera& camera2);

// The same geometry with the images' roles exchanged.
TwoViewGeometry Inverted(const TwoViewGeometry& geometry);

}  // namespace cairn
