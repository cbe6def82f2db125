#include <algorithm>

#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// Half of the points under smaller angles mean that the positions carry nothing.
constexpr double kMinAngleRad = 1e-3;
constexpr size_t kMinPointsPerImage = 5;

// Of the rays to a point, from that of its first image.
double WidestAngle(const Reconstruction& model, const Point3D& point) {
  const auto ray = [&](const TrackElement& element) {
    const Eigen::Vector3d center = model.images.at(element.image_id).cam_from_world.Center();
    return Eigen::Vector3d(point.xyz - center);
  };
  double widest = 0;
  for (const TrackElement& element : point.track) {
    widest = std::max(widest, AngleBetween(ray(point.track.front()), ray(element)));
  }
  return widest;
}

}  // namespace

std::string ReasonToRefuse(const Reconstruction& model) {
  const size_t num_images = model.images.size();
  if (num_images == 0) return "no image has a pose";
  if (num_images == 1) return "only one image has a pose";
  if (model.points3D.size() < kMinPointsPerImage * num_images) {
    return "only " + std::to_string(model.points3D.size()) + " points for " +
           std::to_string(num_images) + " images";
  }
  for (const auto& [id, image] : model.images) {
    if (!image.cam_from_world.Center().allFinite()) {
      return image.image.name + " has no finite position";
    }
  }
  std::vector<double> angles;
  for (const auto& [id, point] : model.points3D) angles.push_back(WidestAngle(model, point));
  const double angle = UpperMedian(angles);
  if (!(angle > kMinAngleRad)) {
    return "the camera positions are collapsed: half of the points are seen under angles below " +
           std::to_string(RadToDeg(angle)) + " degrees";
  }
  return "";
}

}  // namespace cairn
