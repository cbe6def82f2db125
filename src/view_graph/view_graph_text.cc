#include "cairn/view_graph/view_graph_text.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/text.h"
#include "cairn/base/named_value.h"
#include "cairn/view_graph/view_graph_builder.h"
#include "view_graph/active_edges.h"

namespace cairn {
namespace {

using Json = nlohmann::ordered_json;

// Numbers that are not finite become null. A text is one of Graphviz, too.
std::string Dump(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string Name(image_t id, const std::map<image_t, std::string>& names) {
  const auto it = names.find(id);
  return it == names.end() ? std::to_string(id) : it->second;
}

std::vector<int> ActiveDegrees(const ViewGraph& graph) {
  std::vector<int> degrees(graph.image_ids.size(), 0);
  for (const GraphEdge& edge : ActiveEdges(graph).edges) {
    ++degrees[edge.node1];
    ++degrees[edge.node2];
  }
  return degrees;
}

Json EdgeToJson(const ViewEdge& edge) {
  const Eigen::Quaterniond& q = edge.cam2_from_cam1.rotation;
  const Eigen::Vector3d& t = edge.cam2_from_cam1.translation;
  return {{"image_id1", edge.image_id1},
          {"image_id2", edge.image_id2},
          {"num_inliers", edge.num_inliers},
          {"residual_px", edge.residual_px},
          {"triangulation_angle_deg", edge.triangulation_angle_deg},
          {"verifier", edge.verifier},
          {"status", EdgeRemovalName(edge.removal)},
          {"qvec", {q.w(), q.x(), q.y(), q.z()}},
          {"tvec", {t.x(), t.y(), t.z()}}};
}

std::string_view Color(EdgeRemoval removal) {
  using enum EdgeRemoval;
  constexpr NamedValue<EdgeRemoval> kColors[] = {{kNone, "black"},
                                                 {kTooFewInliers, "gray80"},
                                                 {kNoPose, "gray60"},
                                                 {kTripletInconsistent, "orange"},
                                                 {kRotationInconsistent, "red"},
                                                 {kDirectionInconsistent, "magenta"},
                                                 {kOtherComponent, "lightblue"},
                                                 {kAmbiguous, "purple"},
                                                 {kModelInconsistent, "brown"}};
  return NameOf(kColors, removal);
}

}  // namespace

std::string ViewGraphToJson(const ViewGraph& graph, const std::map<image_t, std::string>& names) {
  const std::vector<std::vector<image_t>> components = ActiveComponents(graph);
  std::map<image_t, size_t> component_of;
  for (size_t c = 0; c < components.size(); ++c) {
    for (const image_t id : components[c]) component_of[id] = c;
  }
  const std::vector<int> degrees = ActiveDegrees(graph);
  // Images and edges are a line each.
  std::string text = "{\n\"images\": [\n";
  for (size_t k = 0; k < graph.image_ids.size(); ++k) {
    const image_t id = graph.image_ids[k];
    const auto component = component_of.find(id);
    text +=
        (k > 0 ? ",\n" : "") +
        Dump({{"id", id},
              {"name", Name(id, names)},
              {"degree", degrees[k]},
              {"component", component == component_of.end() ? Json() : Json(component->second)}});
  }
  text += "\n],\n\"edges\": [\n";
  std::map<EdgeRemoval, int> counts;
  for (size_t k = 0; k < graph.edges.size(); ++k) {
    const ViewEdge& edge = graph.edges[k];
    text += (k > 0 ? ",\n" : "") + Dump(EdgeToJson(edge));
    if (!edge.IsActive()) ++counts[edge.removal];
  }
  Json removed = Json::object();
  for (const auto& [removal, count] : counts)
    removed[std::string(EdgeRemovalName(removal))] = count;
  return text + "\n],\n\"removed\": " + Dump(removed) + ",\n\"components\": " + Dump(components) +
         "\n}\n";
}

std::string ViewGraphToDot(const ViewGraph& graph, const std::map<image_t, std::string>& names) {
  std::string text = "graph view_graph {\n  node [shape=box, fontsize=9];\n  overlap=false;\n";
  for (const image_t id : graph.image_ids) {
    text += "  " + std::to_string(id) + " [label=" + Dump(Name(id, names)) + "];\n";
  }
  for (const ViewEdge& edge : graph.edges) {
    // Line width grows with the logarithm of the inliers: 15 give 1, 1500 give 3.
    const double width = std::max(0.5, std::log10(std::max(1, edge.num_inliers)) - 0.2);
    const std::string style =
        Formatted("color=%s, penwidth=%.2f%s, tooltip=\"%d %s\"", Color(edge.removal).data(), width,
                  edge.IsActive() ? "" : ", style=dashed", edge.num_inliers,
                  std::string(EdgeRemovalName(edge.removal)).c_str());
    text += "  " + std::to_string(edge.image_id1) + " -- " + std::to_string(edge.image_id2) + " [" +
            style + "];\n";
  }
  return text + "}\n";
}

}  // namespace cairn
