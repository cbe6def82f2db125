#include "pipeline/stages/given_camera.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/text.h"
#include "cairn/image/bitmap.h"
#include "cairn/image/exif.h"
#include "cairn/intrinsics/focal_calibration.h"

namespace cairn {
namespace {

// So far off the center, as a share of the side, lies no principal point but of cut photographs and
// shifted lenses. Less than a quarter, where a center for twice or half the size lies.
constexpr double kMaxOffCenter = 0.2;
// An equidistant lens of 180 degrees, taken as planar, moves what is half way to the border by a
// factor of 1.27.
constexpr double kMaxDistortion = 2.0;
// Principal points lie within some percent of the center.
constexpr double kCenterTolerance = 0.05;

std::string Number(double value, int num_digits = 6) {
  return Formatted("%.*g", num_digits, value);
}

bool IsPanorama(const Camera& camera) { return camera.FocalIndices().empty(); }

std::string SizeOf(const Camera& camera) { return SizeText({camera.width, camera.height}); }

bool IsNear(double ratio, double expected) {
  return std::abs(std::log(ratio / expected)) < kCenterTolerance;
}

// How much larger than the image one is whose center is the principal point, if that is no
// accident: by a whole number, or its inverse, where that may be.
std::optional<double> OtherSize(const Camera& camera) {
  if (camera.PrincipalPointIndices().size() != 2) return std::nullopt;
  const Eigen::Vector2d ratios =
      camera.PrincipalPoint().cwiseQuotient(0.5 * Eigen::Vector2d(camera.width, camera.height));
  if (ratios.minCoeff() <= 0 || !IsNear(ratios[0], ratios[1])) return std::nullopt;
  const double ratio = ratios.mean();
  const double whole = ratio > 1 ? std::round(ratio) : 1 / std::round(1 / ratio);
  const double factor = IsNear(ratio, whole) ? whole : ratio;
  if (IsNear(factor, 1)) return std::nullopt;
  return factor;
}

std::string ParamsText(const Camera& camera) {
  std::string text;
  for (const double param : camera.params) text += (text.empty() ? "" : ",") + Number(param);
  return text;
}

std::string Advice(const Camera& camera) {
  const std::optional<double> factor = OtherSize(camera);
  if (!factor) {
    const size_t num_others = camera.DistortionIndices().size();
    return "are camera_model and the order right? " + std::string(CameraModelName(camera.model)) +
           " has " + (camera.FocalIndices().size() == 1 ? "f,cx,cy" : "fx,fy,cx,cy") +
           " in pixels of these photographs" +
           (num_others > 0 ? ", and " + std::to_string(num_others) + " of distortion" : "");
  }
  Camera meant = camera;
  for (const int i : meant.FocalIndices()) meant.params[i] /= *factor;
  for (const int i : meant.PrincipalPointIndices()) meant.params[i] /= *factor;
  return "was it calibrated with photographs " + Number(*factor, 3) +
         " times as large? Here it is then " + ParamsText(meant);
}

bool IsInside(const Eigen::Vector2d& point, const Camera& camera) {
  return point.minCoeff() > 0 && point.x() < camera.width && point.y() < camera.height;
}

// "" or the reason why pixels half way to the border are nowhere near where a lens has them.
std::string DistortionFault(const Camera& camera) {
  const Eigen::Vector2d center = camera.PrincipalPoint();
  const double w = camera.width, h = camera.height;
  for (const Eigen::Vector2d& side :
       std::array<Eigen::Vector2d, 4>{{{0.0, h / 2}, {w, h / 2}, {w / 2, 0.0}, {w / 2, h}}}) {
    const Eigen::Vector2d pixel = 0.5 * (center + side);
    const std::optional<Eigen::Vector3d> ray = camera.RayFromImg(pixel);
    if (!ray) return "leaves pixels half way to the border without a direction";
    const bool is_fisheye = CameraModelIsFisheye(camera.model);
    if (!camera.IsPlanar() && !is_fisheye) continue;  // their parameters are no small corrections
    const double angle = std::atan2(ray->head<2>().norm(), ray->z());
    const double distorted =
        (pixel - center).cwiseQuotient(Eigen::Vector2d(camera.FocalX(), camera.FocalY())).norm();
    const double factor = distorted / (is_fisheye ? angle : std::tan(angle));
    if (std::abs(std::log(factor)) < std::log(kMaxDistortion)) continue;
    return "moves pixels half way to the border by a factor of " + Number(factor, 3);
  }
  return "";
}

// "" or why there is no such camera.
std::string FaultText(const Camera& camera) {
  const Eigen::Vector2d center = camera.PrincipalPoint();
  if (!IsInside(center, camera)) {
    return "the principal point " + Number(center.x()) + "," + Number(center.y()) +
           " lies outside photographs of " + SizeOf(camera) + " pixels";
  }
  const double larger_side = std::max(camera.width, camera.height);
  for (const double focal : {camera.FocalX(), camera.FocalY()}) {
    if (focal <= kMaxFocalFactor * larger_side &&
        (!camera.IsPlanar() || focal >= kMinFocalFactor * larger_side)) {
      continue;
    }
    return "no photograph of " + SizeOf(camera) + " pixels has a focal length of " + Number(focal) +
           " pixels";
  }
  const std::string fault = DistortionFault(camera);
  return fault.empty() ? "" : "the distortion " + fault;
}

}  // namespace

std::optional<ResultWarning> FindFault(const Camera& camera) {
  if (IsPanorama(camera)) return std::nullopt;
  const std::string fault = FaultText(camera);
  if (fault.empty()) return std::nullopt;
  return ResultWarning{fault, Advice(camera)};
}

std::vector<ResultWarning> FindDoubts(const Camera& camera, std::optional<double> exif_focal_px) {
  std::vector<ResultWarning> doubts;
  if (IsPanorama(camera)) return doubts;
  const Eigen::Vector2d center = camera.PrincipalPoint();
  const Eigen::Vector2d size(camera.width, camera.height);
  if ((center.cwiseQuotient(size).array() - 0.5).abs().maxCoeff() > kMaxOffCenter) {
    doubts.push_back({"the given principal point " + Number(center.x()) + "," + Number(center.y()) +
                          " is far from the center of photographs of " + SizeOf(camera) + " pixels",
                      Advice(camera)});
  }
  const double max_error = kFarSigmas * FocalCalibrationOptions().exif_sigma;
  if (exif_focal_px && std::abs(std::log(camera.MeanFocal() / *exif_focal_px)) > max_error) {
    doubts.push_back({"the given focal length of " + Number(camera.MeanFocal()) +
                          " pixels is not EXIF's, " + Number(std::round(*exif_focal_px)) +
                          ", for photographs of " + SizeOf(camera) + " pixels",
                      Advice(camera)});
  }
  return doubts;
}

}  // namespace cairn
