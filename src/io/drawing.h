#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "cairn/io/ply.h"

namespace cairn {

// What viewers are shown of a model: its points, then per camera its center and the image's four
// corners at a depth, with edges between them.
struct Drawing {
  struct Vertex {
    Eigen::Vector3d xyz;
    std::array<uint8_t, 3> color;
  };
  std::vector<Vertex> vertices;
  std::vector<std::pair<int, int>> edges;
  size_t num_points = 0;  // the first vertices
  double frustum_depth = 1;
};

inline constexpr std::array<uint8_t, 3> kFrustumColor = {255, 128, 0};

Drawing Draw(const Reconstruction& reconstruction, const PlyOptions& options);

}  // namespace cairn
