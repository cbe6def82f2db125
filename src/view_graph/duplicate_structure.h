#pragma once

#include <cstddef>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/scene/reconstruction.h"
#include "cairn/scene/view_graph.h"

namespace cairn {

// Groups of images that look at different places which look alike in part, so that the model shows
// one on top of the other.
struct DuplicateStructure {
  // Active edges between the groups: indices in graph.edges, ascending; empty: one place.
  std::vector<size_t> edges;
  // Active edges whose images show enough in common to tell, and of these, that see two places.
  int num_told = 0, num_conflicting = 0;
  std::vector<image_t> images{};  // of the conflicting ones

  // Groups may not be told where few edges tell. Of right models, at most 4 in 100 conflict.
  bool IsDoubtful() const { return num_conflicting >= 5 && 10 * num_conflicting > num_told; }
};

// By missing correspondences (Zach, Irschara, Bischof, "What can missing correspondences tell us
// about 3D structure and motion?", 2008; Heinly, Dunn, Frahm, "Correcting for duplicate scene
// structure in sparse 3D reconstruction", 2014): what lies around the common part is matched within
// the groups and, although images of both show it, never across.
DuplicateStructure FindDuplicateStructure(const Reconstruction& model, const ViewGraph& graph,
                                          const RunContext& run = {});

}  // namespace cairn
