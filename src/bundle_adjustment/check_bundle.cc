#include "bundle_adjustment/check_bundle.h"

#include <cmath>

#include "cairn/base/error.h"
#include "scene/view_table.h"

namespace cairn {
namespace {

[[noreturn]] void Refuse(const std::string& what) { throw ConfigError("reconstruction", what); }

std::string Name(const char* kind, uint64_t id) {
  return std::string(kind) + " " + std::to_string(id);
}

void CheckImage(const Reconstruction& reconstruction, image_t id, const RegisteredImage& image) {
  const camera_t camera_id = image.image.camera_id;
  if (reconstruction.cameras.count(camera_id) == 0) {
    Refuse(Name("image", id) + " refers to " + Name("camera", camera_id) + ", which is not there");
  }
  if (!image.sigmas_px.empty() && image.sigmas_px.size() != image.points2D.size()) {
    Refuse(Name("image", id) + " has not as many standard deviations as keypoints");
  }
}

bool IsNumber(const PositionPrior& prior) {
  return prior.position.allFinite() && prior.precision.allFinite() &&
         prior.precision.minCoeff() >= 0;
}

bool IsNumber(const IntrinsicsPrior& prior, bool has_free_focal) {
  bool is_number =
      prior.principal_point_sigma_px >= 0 && (prior.focal_sigma > 0 || !has_free_focal);
  for (const double param : prior.params) is_number &= std::isfinite(param);
  return is_number;
}

std::string FaultOfPoint(const Point3D& point, const ViewTable& views) {
  if (!point.xyz.allFinite()) return "is not finite";
  for (const TrackElement& element : point.track) {
    const ViewTable::View& view = views.Of(element.image_id);
    if (view.Pixel(element.point2D).allFinite() && view.SigmaPx(element.point2D) > 0) continue;
    return "is seen at " + Name("keypoint", element.point2D) + " of " +
           Name("image", element.image_id) + ", whose position or standard deviation is none";
  }
  return "";
}

}  // namespace

void CheckBundle(const Reconstruction& reconstruction, const BundleAdjustmentScope& scope) {
  for (const auto& [id, camera] : reconstruction.cameras) {
    const bool is_model = CameraModelFromId(static_cast<int>(camera.model)).has_value();
    if (!is_model || std::ssize(camera.params) != CameraModelNumParams(camera.model)) {
      Refuse(Name("camera", id) + ": " + camera.Validate());
    }
  }
  for (const auto& [id, image] : reconstruction.images) CheckImage(reconstruction, id, image);
  const ViewTable views(reconstruction);
  for (const auto& [id, point] : reconstruction.points3D) {
    for (const TrackElement& element : point.track) {
      const ViewTable::View* view = views.Find(element.image_id);
      if (view != nullptr && element.point2D < view->image->points2D.size()) continue;
      Refuse(Name("point", id) + " refers to " + Name("keypoint", element.point2D) + " of " +
             Name("image", element.image_id) + ", which is not there");
    }
  }
  for (const auto& [id, prior] : scope.priors) {
    const auto camera = reconstruction.cameras.find(id);
    if (camera == reconstruction.cameras.end()) continue;
    if (prior.params.size() == camera->second.params.size()) continue;
    throw ConfigError("priors", Name("camera", id) + " has another number of parameters");
  }
  for (const SurveyedPoint& point : scope.surveyed_points) {
    for (const auto& [id, pixel] : point.pixels) {
      if (reconstruction.images.count(id) > 0) continue;
      throw ConfigError("surveyed_points", "there is no " + Name("image", id));
    }
  }
}

std::string FaultOfValues(const Reconstruction& reconstruction,
                          const BundleAdjustmentScope& scope) {
  for (const auto& [id, camera] : reconstruction.cameras) {
    const std::string reason = camera.Validate();
    if (!reason.empty()) return Name("camera", id) + ": " + reason;
  }
  for (const auto& [id, image] : reconstruction.images) {
    const Rigid3d& pose = image.cam_from_world;
    if (!pose.translation.allFinite() || !(std::abs(pose.rotation.norm() - 1) < 1e-6)) {
      return "the pose of " + Name("image", id) + " is none";
    }
  }
  const ViewTable views(reconstruction);
  for (const auto& [id, point] : reconstruction.points3D) {
    const std::string fault = FaultOfPoint(point, views);
    if (!fault.empty()) return Name("point", id) + " " + fault;
  }
  for (const auto& [id, prior] : scope.priors) {
    if (!IsNumber(prior, scope.focal_lengths))
      return "the prior of " + Name("camera", id) + " is none";
  }
  for (const auto& [id, prior] : scope.image_positions) {
    if (!IsNumber(prior)) return "the known position of " + Name("image", id) + " is none";
  }
  for (const SurveyedPoint& point : scope.surveyed_points) {
    if (!IsNumber(point.prior)) return "a surveyed point's position is none";
  }
  return "";
}

}  // namespace cairn
