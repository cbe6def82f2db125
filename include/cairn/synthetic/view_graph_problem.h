#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/scene/view_graph.h"
#include "cairn/synthetic/poses.h"

namespace cairn {

// A view graph without images, like those of the 1DSfM data sets, of any size.
struct ViewGraphOptions : EdgeNoise {
  CameraLayout layout = CameraLayout::kLandmark;  // any but kCity
  int num_images = 200;
  double distance = 3.0;  // as in RigOptions
  int num_edges = 0;      // 0: 20 an image, or all pairs where there are fewer
  // Share of edges whose pose has nothing to do with the truth.
  double outlier_ratio = 0.0;

  ViewGraphOptions() : EdgeNoise{0.5, 1.0} {}
  // All but layout, num_images and distance, which RigOptions lists.
  void VisitFields(OptionVisitor& v);
};

struct ViewGraphProblem {
  ViewGraph graph;                            // connected, normalized; ids 1 .. num_images
  std::map<image_t, Rigid3d> cam_from_world;  // the truth
  std::vector<bool> is_outlier;               // one an edge of graph, in its order
};

// Throws ConfigError if num_edges is too small for a connected graph, or too large.
ViewGraphProblem MakeViewGraphProblem(const ViewGraphOptions& options, uint64_t seed);

}  // namespace cairn
