#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "cairn/translation_averaging/translation_averaging.h"
#include "graph/graph.h"

namespace cairn {

// Cameras are 0 .. n-1 by increasing image id; edges and tracks are in an order that depends on
// their content alone. All directions have length 1.
struct DirectionProblem {
  struct Edge {
    int camera1 = 0;
    int camera2 = 0;
    Eigen::Vector3d direction;  // of c2 - c1
    double length = 0;          // as DirectionEdge has it
    int num_points = 0;
  };
  struct Ray {
    int camera = 0;
    Eigen::Vector3d direction;
  };

  std::vector<image_t> image_ids;
  std::vector<Edge> edges;
  std::vector<int> edge_of_input;
  // Rays of track k: rays[track_begin[k]] .. rays[track_begin[k + 1] - 1], by camera.
  std::vector<int> track_begin = {0};
  std::vector<Ray> rays;

  int NumCameras() const { return static_cast<int>(image_ids.size()); }
  int NumTracks() const { return static_cast<int>(track_begin.size()) - 1; }
  std::span<const Ray> RaysOf(int track) const {
    return {rays.data() + track_begin[track], rays.data() + track_begin[track + 1]};
  }
};

DirectionProblem MakeDirectionProblem(std::span<const DirectionEdge> edges,
                                      std::span<const PointDirections> tracks);

// Keeps these cameras (sorted), the edges among them that are not in `edge_is_out`, and what is
// left of the tracks if that is at least two rays.
DirectionProblem Restrict(const DirectionProblem& problem, const std::vector<int>& cameras,
                          const std::vector<char>& edge_is_out);

}  // namespace cairn
