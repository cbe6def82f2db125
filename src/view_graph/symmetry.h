#pragma once

#include <vector>

#include "cairn/scene/reconstruction.h"
#include "cairn/scene/view_graph.h"

namespace cairn {

// Pairs that are not in use and agree with each other on one rotation of the scene. So do those of
// a building with several equal sides, if the model shows one side in place of all.
struct Symmetry {
  int num_pairs = 0;            // that agree with each other, against the model
  int num_active = 0;           // pairs that agree with the model
  double angle_deg = 0;         // of the rotation
  std::vector<image_t> images;  // of these pairs, ascending

  bool IsFold() const { return num_pairs >= 6 && num_pairs > 0.15 * num_active; }
};
Symmetry FindSymmetry(const Reconstruction& model, const ViewGraph& graph);

}  // namespace cairn
