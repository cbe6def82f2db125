#include "cairn/view_graph/view_graph_builder.h"
#include "mapper/stages.h"

namespace cairn {

std::optional<std::map<image_t, Eigen::Quaterniond>> ChooseEdges(
    StageContext& context, const std::map<image_t, Eigen::Quaterniond>& cam_from_world,
    ViewGraph& graph) {
  ModelStage stage(context, "edges");
  const double max_error_deg = context.settings.view_graph.max_rotation_error_deg;
  stage.Add("edges_in", graph.NumActiveEdges());
  stage.Add("refitted", context.scene.poses_imported
                            ? 0
                            : RefitEdges(context, cam_from_world, max_error_deg, graph));
  stage.Add("edges_removed", RemoveRotationOutliers(cam_from_world, max_error_deg, graph));
  const std::vector<std::vector<image_t>> components = ActiveComponents(graph);
  if (components.empty()) {
    stage.Fail("no edge agrees with the global rotations",
               "try a larger --view_graph.max_rotation_error_deg");
    return std::nullopt;
  }
  if (components.size() > 1) KeepImages(components.front(), graph);
  std::map<image_t, Eigen::Quaterniond> rotations;
  for (const image_t id : components.front()) rotations[id] = cam_from_world.at(id);
  stage.Add("images_out", rotations.size());
  return rotations;
}

bool IsWithin(const ViewEdge& edge, const Reconstruction& model) {
  return edge.removal != EdgeRemoval::kAmbiguous && model.images.contains(edge.image_id1) &&
         model.images.contains(edge.image_id2);
}

int64_t ReviseEdges(const ModelEvidence& evidence, const Reconstruction& model, ViewGraph& graph) {
  int64_t num_gained = 0;
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    ViewEdge& edge = graph.edges[e];
    const Support& support = evidence.pairs[e];
    if (support.num_matches == 0 || !IsWithin(edge, model)) continue;
    if (support.IsContradicted()) {
      const bool was_outside = edge.removal == EdgeRemoval::kOtherComponent;
      if (edge.IsActive() || was_outside) edge.removal = EdgeRemoval::kModelInconsistent;
    } else if (!edge.IsActive()) {
      edge.removal = EdgeRemoval::kNone;
      num_gained += support.num_explained;
    }
  }
  return num_gained;
}

}  // namespace cairn
