#include "cairn/scene/two_view_geometry.h"

#include <Eigen/LU>
#include <iterator>
#include <utility>

namespace cairn {

std::string_view TwoViewConfigName(TwoViewConfig config) {
  constexpr std::string_view kNames[] = {"undefined",           "degenerate", "calibrated",
                                         "uncalibrated",        "planar",     "panoramic",
                                         "planar_or_panoramic", "watermark",  "multiple"};
  const auto index = static_cast<size_t>(config);
  return index < std::size(kNames) ? kNames[index] : "unknown";
}

std::optional<Eigen::Matrix3d> EssentialOf(const TwoViewGeometry& geometry, const Camera& camera1,
                                           const Camera& camera2) {
  std::optional<Eigen::Matrix3d> E = geometry.E;
  if (!E && geometry.F && camera1.IsPlanar() && camera2.IsPlanar()) {
    E = camera2.CalibrationMatrix().transpose() * *geometry.F * camera1.CalibrationMatrix();
  }
  if (E && !(E->allFinite() && E->norm() > 0)) E.reset();
  return E;
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
