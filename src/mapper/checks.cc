#include <algorithm>

#include "cairn/math/median.h"
#include "cairn/triangulation/triangulation.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// Half of the cameras within this share of the extent of all of them, or of the distance to the
// points they see, means that the positions carry nothing.
constexpr double kMinSpread = 1e-3;
constexpr size_t kMinPointsPerImage = 5;

}  // namespace

std::string ReasonToRefuse(const Reconstruction& model) {
  const size_t num_images = model.images.size();
  if (num_images < 2) return "only " + std::to_string(num_images) + " images have a pose";
  if (model.points3D.size() < kMinPointsPerImage * num_images) {
    return "only " + std::to_string(model.points3D.size()) + " points for " +
           std::to_string(num_images) + " images";
  }
  std::map<image_t, Eigen::Vector3d> centers;
  std::vector<double> coordinates[3];
  for (const auto& [id, image] : model.images) {
    centers[id] = image.cam_from_world.Center();
    if (!centers[id].allFinite()) return image.image.name + " has no finite position";
    for (int k = 0; k < 3; ++k) coordinates[k].push_back(centers[id][k]);
  }
  // Not the mean: a few cameras far away must not hide that the others are in one place.
  const Eigen::Vector3d middle(UpperMedian(coordinates[0]), UpperMedian(coordinates[1]),
                               UpperMedian(coordinates[2]));
  std::vector<double> from_middle;
  for (const auto& [id, center] : centers) from_middle.push_back((center - middle).norm());
  std::vector<double> depths;
  for (const auto& [id, point] : model.points3D) {
    depths.push_back((point.xyz - centers.at(point.track.front().image_id)).norm());
  }
  const double extent = *std::max_element(from_middle.begin(), from_middle.end());
  const double spread = UpperMedian(from_middle);
  if (!(spread > kMinSpread * extent) || !(extent > kMinSpread * UpperMedian(depths))) {
    return "the camera positions are collapsed: half of them lie within " +
           std::to_string(spread / std::max(extent, 1e-300)) + " of their extent, which is " +
           std::to_string(extent / std::max(UpperMedian(depths), 1e-300)) +
           " of the distance to the points";
  }
  return "";
}

}  // namespace cairn
