#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/base/types.h"
#include "cairn/scene/view_graph.h"
#include "cairn/view_graph/options.h"

namespace cairn {

// Loops of three, counted once at each of their edges (at most 64 an edge).
struct LoopReport {
  int64_t num_loops = 0;
  int64_t num_closed = 0;
};

// How many edges the filters removed, by reason.
struct ViewGraphReport {
  int num_edges = 0;
  int num_active_edges = 0;
  std::map<EdgeRemoval, int> num_removed;
  LoopReport loops;
  // Connected components of the active edges with at least two images, largest first.
  std::vector<std::vector<image_t>> components;
};

struct ViewGraphResult {
  ViewGraph graph;
  ViewGraphReport report;
};

// The view graph of verified pairs, with every edge kept and the reason on those that are out: too
// few inliers, loops of three that do not close, duplicate structure. Edges that come with a
// removal reason keep it (kNoPose: set by the caller for pairs without a pose). Components are not
// chosen here (see KeepImages).
ViewGraphResult BuildViewGraph(std::vector<image_t> image_ids, std::vector<ViewEdge> edges,
                               const ViewGraphBuilderOptions& options = {},
                               const RunContext& run = {});

// The single steps. Each looks at active edges only.

// The relative rotation of an edge's images by global rotations; nullopt: one of them has none.
std::optional<Eigen::Quaterniond> RelativeRotation(
    const ViewEdge& edge, const std::map<image_t, Eigen::Quaterniond>& cam_from_world);

// Edges that disagree with global rotations by more than max_error_deg, or that have an image
// without one (kRotationInconsistent). Returns how many.
int RemoveRotationOutliers(const std::map<image_t, Eigen::Quaterniond>& cam_from_world,
                           double max_error_deg, ViewGraph& graph);

// By how much the rotations of a loop of three edges miss each other, degrees: those of `edge`, of
// the one that goes on from its first image, and of the one from its second.
double LoopErrorDeg(const ViewEdge& edge, const ViewEdge& from_first, const ViewEdge& from_second);

// Loops of three rotations. An edge that closes in no loop, though in some of them the other two
// edges do close in loops elsewhere, goes (kTripletInconsistent): of a single loop that does not
// close it is unknown which edge is wrong, so they stay. With filter_ambiguous, so does one that
// closes in some loops but is contradicted by many more, all of edges better supported than itself
// (kAmbiguous). Returns the loops as they were.
LoopReport RemoveInconsistentTriplets(ViewGraph& graph, const ViewGraphBuilderOptions& options = {},
                                      const RunContext& run = {});

// Connected components of the active edges, with at least two images, largest first.
std::vector<std::vector<image_t>> ActiveComponents(const ViewGraph& graph);

// Takes out all edges that do not lie among these images (kOtherComponent).
void KeepImages(std::span<const image_t> image_ids, ViewGraph& graph);

}  // namespace cairn
