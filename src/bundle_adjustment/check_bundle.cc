#include "bundle_adjustment/check_bundle.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "cairn/base/error.h"
#include "scene/view_table.h"

namespace cairn {
namespace {

[[noreturn]] void Refuse(const std::string& what) { throw ConfigError("reconstruction", what); }

std::string Name(const char* kind, uint64_t id) {
  return std::string(kind) + " " + std::to_string(id);
}

// Each returns the fault of values, and refuses what does not fit.

std::string CheckCamera(camera_t id, const Camera& camera) {
  const std::string reason = camera.Validate();
  if (reason.empty()) return "";
  const bool is_model = CameraModelFromId(static_cast<int>(camera.model)).has_value();
  const std::string fault = Name("camera", id) + ": " + reason;
  if (!is_model || std::ssize(camera.params) != CameraModelNumParams(camera.model)) Refuse(fault);
  return fault;
}

std::string CheckImage(const Reconstruction& model, image_t id, const RegisteredImage& image) {
  constexpr double kMaxDefect = 1e-3;  // of a rotation's length
  const camera_t camera_id = image.image.camera_id;
  if (!model.cameras.contains(camera_id)) {
    Refuse(Name("image", id) + " refers to " + Name("camera", camera_id) + ", which is not there");
  }
  if (!image.sigmas_px.empty() && image.sigmas_px.size() != image.points2D.size()) {
    Refuse(Name("image", id) + " has not as many standard deviations as keypoints");
  }
  const Rigid3d& pose = image.cam_from_world;
  const bool is_pose = pose.translation.allFinite() &&
                       std::abs(pose.rotation.norm() - 1) < kMaxDefect;  // false: not a number
  return is_pose ? "" : "the pose of " + Name("image", id) + " is not finite, or no rotation";
}

std::string CheckPoint(const ViewTable& views, point3D_t id, const Point3D& point) {
  for (const auto& [image_id, index] : point.track) {
    const ViewTable::View* view = views.Find(image_id);
    const bool is_there = view != nullptr && index < view->image->points2D.size();
    if (is_there && view->Pixel(index).allFinite() && view->SigmaPx(index) > 0) continue;
    const std::string keypoint = Name("keypoint", index) + " of " + Name("image", image_id);
    if (!is_there) Refuse(Name("point", id) + " refers to " + keypoint + ", which is not there");
    return Name("point", id) + " is seen at " + keypoint +
           ", whose position is not finite, or whose standard deviation is not positive";
  }
  return point.xyz.allFinite() ? "" : Name("point", id) + " is not finite";
}

std::string CheckPrior(const Reconstruction& model, bool has_free_focal, camera_t id,
                       const IntrinsicsPrior& prior) {
  const auto camera = model.cameras.find(id);
  if (camera == model.cameras.end()) return "";
  if (prior.params.size() != camera->second.params.size()) {
    throw ConfigError("priors", Name("camera", id) + " has another number of parameters");
  }
  const bool is_prior =
      std::ranges::all_of(prior.params, [](double p) { return std::isfinite(p); }) &&
      prior.principal_point_sigma_px >= 0 && (prior.focal_sigma > 0 || !has_free_focal);
  return is_prior ? "" : "the prior of " + Name("camera", id) + " is not finite or not positive";
}

bool IsFinite(const PositionPrior& prior) {
  return prior.position.allFinite() && prior.precision.allFinite() &&
         prior.precision.minCoeff() >= 0;
}

std::string CheckSurveyedPoint(const Reconstruction& model, const SurveyedPoint& point) {
  for (const auto& [id, pixel] : point.pixels) {
    if (!model.images.contains(id)) {
      throw ConfigError("surveyed_points", "there is no " + Name("image", id));
    }
    if (!pixel.allFinite())
      return "a surveyed point's pixel in " + Name("image", id) + " is not finite";
  }
  return IsFinite(point.prior) ? "" : "a surveyed point's position is not finite";
}

}  // namespace

std::string CheckBundle(const Reconstruction& reconstruction, const BundleAdjustmentScope& scope) {
  std::string first;
  const auto note = [&first](std::string fault) {
    if (first.empty()) first = std::move(fault);
  };
  for (const auto& [id, camera] : reconstruction.cameras) note(CheckCamera(id, camera));
  for (const auto& [id, image] : reconstruction.images) {
    note(CheckImage(reconstruction, id, image));
  }
  const ViewTable views(reconstruction);
  for (const auto& [id, point] : reconstruction.points3D) note(CheckPoint(views, id, point));
  for (const auto& [id, prior] : scope.priors) {
    note(CheckPrior(reconstruction, scope.focal_lengths, id, prior));
  }
  for (const auto& [id, prior] : scope.image_positions) {
    if (!IsFinite(prior)) note("the known position of " + Name("image", id) + " is not finite");
  }
  for (const SurveyedPoint& point : scope.surveyed_points) {
    note(CheckSurveyedPoint(reconstruction, point));
  }
  return first;
}

}  // namespace cairn
