#include "cairn/view_graph/view_graph_builder.h"

#include <algorithm>

#include "cairn/base/check.h"
#include "cairn/math/angles.h"
#include "graph/graph.h"
#include "view_graph/active_edges.h"

namespace cairn {
namespace {

// Where inliers were counted, not in EdgeSource::kDataset (kTooFewInliers).
void RemoveWeakEdges(int min_num_inliers, ViewGraph& graph) {
  for (ViewEdge& edge : graph.edges) {
    if (!edge.IsActive() || edge.source == EdgeSource::kDataset) continue;
    if (edge.num_inliers < min_num_inliers) edge.removal = EdgeRemoval::kTooFewInliers;
  }
}

}  // namespace

std::optional<Eigen::Quaterniond> RelativeRotation(
    const ViewEdge& edge, const std::map<image_t, Eigen::Quaterniond>& cam_from_world) {
  const auto rotation1 = cam_from_world.find(edge.image_id1);
  const auto rotation2 = cam_from_world.find(edge.image_id2);
  if (rotation1 == cam_from_world.end() || rotation2 == cam_from_world.end()) return std::nullopt;
  return rotation2->second * rotation1->second.conjugate();
}

int RemoveRotationOutliers(const std::map<image_t, Eigen::Quaterniond>& cam_from_world,
                           double max_error_deg, ViewGraph& graph) {
  int num_removed = 0;
  for (ViewEdge& edge : graph.edges) {
    if (!edge.IsActive()) continue;
    const auto rotation = RelativeRotation(edge, cam_from_world);
    if (rotation &&
        RadToDeg(AngleBetween(*rotation, edge.cam2_from_cam1.rotation)) <= max_error_deg) {
      continue;
    }
    edge.removal = EdgeRemoval::kRotationInconsistent;
    ++num_removed;
  }
  return num_removed;
}

std::vector<std::vector<image_t>> ActiveComponents(const ViewGraph& graph) {
  const GraphComponents components =
      ConnectedComponents(static_cast<int>(graph.image_ids.size()), ActiveEdges(graph).edges);
  std::vector<std::vector<image_t>> result;
  for (const std::vector<int>& nodes : components.nodes) {
    if (nodes.size() < 2) break;
    result.emplace_back();
    for (const int node : nodes) result.back().push_back(graph.image_ids[node]);
  }
  return result;
}

void KeepImages(std::span<const image_t> image_ids, ViewGraph& graph) {
  std::vector<image_t> kept(image_ids.begin(), image_ids.end());
  std::sort(kept.begin(), kept.end());
  const auto is_kept = [&](image_t id) { return std::binary_search(kept.begin(), kept.end(), id); };
  for (ViewEdge& edge : graph.edges) {
    if (!edge.IsActive() || (is_kept(edge.image_id1) && is_kept(edge.image_id2))) continue;
    edge.removal = EdgeRemoval::kOtherComponent;
  }
}

ViewGraphResult BuildViewGraph(std::vector<image_t> image_ids, std::vector<ViewEdge> edges,
                               const ViewGraphBuilderOptions& options, const RunContext& run) {
  ValidateOptions(options, "view_graph");
  ViewGraphResult result;
  ViewGraph& graph = result.graph;
  ViewGraphReport& report = result.report;
  graph.image_ids = std::move(image_ids);
  graph.edges = std::move(edges);
  graph.Normalize();

  RemoveWeakEdges(options.min_num_inliers, graph);
  report.loops = RemoveInconsistentTriplets(graph, options, run);

  report.num_edges = static_cast<int>(graph.edges.size());
  report.num_active_edges = graph.NumActiveEdges();
  for (const ViewEdge& edge : graph.edges) {
    if (!edge.IsActive()) ++report.num_removed[edge.removal];
  }
  report.components = ActiveComponents(graph);
  run.monitor.Info("view graph: " + std::to_string(report.num_active_edges) + " of " +
                   std::to_string(report.num_edges) + " pairs in use, " +
                   std::to_string(report.components.size()) + " component(s)");
  return result;
}

}  // namespace cairn
