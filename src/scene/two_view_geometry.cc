#include "cairn/scene/two_view_geometry.h"

#include <Eigen/LU>
#include <utility>

namespace cairn {

std::string_view TwoViewConfigName(TwoViewConfig config) {
  switch (config) {
    case TwoViewConfig::kUndefined:
      return "undefined";
    case TwoViewConfig::kDegenerate:
      return "degenerate";
    case TwoViewConfig::kCalibrated:
      return "calibrated";
    case TwoViewConfig::kUncalibrated:
      return "uncalibrated";
    case TwoViewConfig::kPlanar:
      return "planar";
    case TwoViewConfig::kPanoramic:
      return "panoramic";
    case TwoViewConfig::kPlanarOrPanoramic:
      return "planar_or_panoramic";
    case TwoViewConfig::kWatermark:
      return "watermark";
    case TwoViewConfig::kMultiple:
      return "multiple";
  }
  return "unknown";
}

TwoViewGeometry Inverted(const TwoViewGeometry& geometry) {
  TwoViewGeometry out = geometry;
  if (out.cam2_from_cam1) out.cam2_from_cam1 = Inverse(*geometry.cam2_from_cam1);
  if (out.E) out.E = geometry.E->transpose().eval();
  if (out.F) out.F = geometry.F->transpose().eval();
  if (out.H) out.H = geometry.H->inverse().eval();
  for (FeatureMatch& match : out.inlier_matches) std::swap(match.point1, match.point2);
  return out;
}

}  // namespace cairn
