#include "cairn/io/ply.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "cairn/math/median.h"
#include "io/byte_writer.h"

namespace cairn {
namespace {

struct Vertex {
  Eigen::Vector3d xyz;
  std::array<uint8_t, 3> color;
};

constexpr std::array<uint8_t, 3> kCenterColor = {255, 0, 0};
constexpr std::array<uint8_t, 3> kFrustumColor = {255, 128, 0};

// A fifth of the median distance to the nearest other camera; 1 where there is none.
double DefaultFrustumDepth(const Reconstruction& reconstruction) {
  std::vector<Eigen::Vector3d> centers;
  for (const auto& [id, image] : reconstruction.images) {
    centers.push_back(image.cam_from_world.Center());
  }
  std::vector<double> distances;
  for (size_t i = 0; i < centers.size(); ++i) {
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
               std::vector<Vertex>& vertices, std::vector<std::pair<int, int>>& edges) {
  const int center = static_cast<int>(vertices.size());
  const Rigid3d world_from_cam = Inverse(cam_from_world);
  vertices.push_back({world_from_cam.translation, kCenterColor});
  const double half_width = 0.5 * (camera.width > 0 ? camera.width / camera.FocalX() : 1.0);
  const double half_height = 0.5 * (camera.height > 0 ? camera.height / camera.FocalY() : 1.0);
  constexpr int kCorners[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
  for (int i = 0; i < 4; ++i) {
    const Eigen::Vector3d corner(kCorners[i][0] * half_width, kCorners[i][1] * half_height, 1.0);
    vertices.push_back({world_from_cam * Eigen::Vector3d(depth * corner), kFrustumColor});
    edges.emplace_back(center, center + 1 + i);
    edges.emplace_back(center + 1 + i, center + 1 + (i + 1) % 4);
  }
}

std::string Header(size_t num_vertices, size_t num_edges) {
  std::string header =
      "ply\nformat binary_little_endian 1.0\ncomment written by cairn\nelement vertex " +
      std::to_string(num_vertices) +
      "\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  if (num_edges > 0) {
    header += "element edge " + std::to_string(num_edges) +
              "\nproperty int vertex1\nproperty int vertex2\n"
              "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  }
  return header + "end_header\n";
}

}  // namespace

void WritePly(const Reconstruction& reconstruction, const std::string& path,
              const PlyOptions& options) {
  std::vector<Vertex> vertices;
  std::vector<std::pair<int, int>> edges;
  if (options.points) {
    for (const auto& [id, point] : reconstruction.points3D) {
      vertices.push_back({point.xyz, point.color});
    }
  }
  if (options.cameras) {
    const double depth =
        options.frustum_depth > 0 ? options.frustum_depth : DefaultFrustumDepth(reconstruction);
    for (const auto& [id, image] : reconstruction.images) {
      AddCamera(reconstruction.CameraOf(image), image.cam_from_world, depth, vertices, edges);
    }
  }
  ByteWriter out(path);
  out << Header(vertices.size(), edges.size());
  for (const Vertex& vertex : vertices) {
    for (int i = 0; i < 3; ++i) out << static_cast<float>(vertex.xyz[i]);
    for (const uint8_t channel : vertex.color) out << channel;
  }
  for (const auto& [vertex1, vertex2] : edges) {
    out << int32_t{vertex1} << int32_t{vertex2};
    for (const uint8_t channel : kFrustumColor) out << channel;
  }
  out.Commit();
}

}  // namespace cairn
