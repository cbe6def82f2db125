#include "io/drawing.h"

#include <algorithm>
#include <limits>

#include "cairn/math/median.h"

namespace cairn {
namespace {

constexpr std::array<uint8_t, 3> kCenterColor = {255, 0, 0};

// A fifth of the median distance to the nearest other camera, of some 2,000 cameras; 1 where there
// is none.
double FrustumDepth(const Reconstruction& reconstruction) {
  std::vector<Eigen::Vector3d> centers;
  for (const auto& [id, image] : reconstruction.images) {
    centers.push_back(image.cam_from_world.Center());
  }
  const size_t step = 1 + centers.size() / 2000;
  std::vector<double> distances;
  for (size_t i = 0; i < centers.size(); i += step) {
    double nearest = std::numeric_limits<double>::infinity();
    for (size_t j = 0; j < centers.size(); ++j) {
      if (i != j) nearest = std::min(nearest, (centers[i] - centers[j]).norm());
    }
    distances.push_back(nearest);
  }
  if (distances.size() < 2) return 1.0;
  const double median = UpperMedian(std::move(distances));
  return median > 0 ? 0.2 * median : 1.0;
}

// The center and the image's four corners at a depth. A camera of unknown size (from a Bundler
// file) is drawn as if its image were as wide and high as its focal length.
void AddCamera(const Camera& camera, const Rigid3d& cam_from_world, double depth,
               Drawing& drawing) {
  const int center = static_cast<int>(drawing.vertices.size());
  const Rigid3d world_from_cam = Inverse(cam_from_world);
  drawing.vertices.push_back({world_from_cam.translation, kCenterColor});
  const double half_width = 0.5 * (camera.width > 0 ? camera.width / camera.FocalX() : 1.0);
  const double half_height = 0.5 * (camera.height > 0 ? camera.height / camera.FocalY() : 1.0);
  constexpr int kCorners[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d corner(kCorners[i][0] * half_width, kCorners[i][1] * half_height, 1.0);
    drawing.vertices.push_back({world_from_cam * Eigen::Vector3d(depth * corner), kFrustumColor});
    drawing.edges.emplace_back(center, center + 1 + i);
    drawing.edges.emplace_back(center + 1 + i, center + 1 + (i + 1) % 4);
  }
}

}  // namespace

Drawing Draw(const Reconstruction& reconstruction, const PlyOptions& options) {
  Drawing drawing;
  for (const auto& [id, point] : reconstruction.points3D) {
    drawing.vertices.push_back({point.xyz, point.color});
  }
  drawing.num_points = drawing.vertices.size();
  if (!options.cameras) return drawing;
  drawing.frustum_depth = FrustumDepth(reconstruction);
  for (const auto& [id, image] : reconstruction.images) {
    AddCamera(reconstruction.CameraOf(image), image.cam_from_world, drawing.frustum_depth, drawing);
  }
  return drawing;
}

}  // namespace cairn
