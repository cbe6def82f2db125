#pragma once

#include <cstddef>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/scene/reconstruction.h"
#include "cairn/scene/view_graph.h"

namespace cairn {

// Active edges between groups of images that look at different places which look alike in part, so
// that the model shows one on top of the other (duplicate structure): what lies around the common
// part is matched within the groups and, although images of both show it, never across (missing
// correspondences; Zach, Irschara, Bischof, "What can missing correspondences tell us about 3D
// structure and motion?", 2008; Heinly, Dunn, Frahm, "Correcting for duplicate scene structure in
// sparse 3D reconstruction", 2014). Indices in graph.edges, ascending; empty: one place.
std::vector<size_t> EdgesBetweenDuplicates(const Reconstruction& model, const ViewGraph& graph,
                                           const RunContext& run = {});

}  // namespace cairn
