#include "cairn/view_graph/view_graph_text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <initializer_list>
#include <string_view>
#include <vector>

#include "cairn/view_graph/view_graph_builder.h"
#include "view_graph/active_edges.h"

namespace cairn {
namespace {

std::string Name(image_t id, const std::map<image_t, std::string>& names) {
  const auto it = names.find(id);
  return it == names.end() ? std::to_string(id) : it->second;
}

// As a string of JSON and of Graphviz alike.
std::string Quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    if (static_cast<unsigned char>(c) >= 0x20) {
      result += c;
    } else {
      char escaped[8];
      std::snprintf(escaped, sizeof(escaped), "\\u%04x", c);
      result += escaped;
    }
  }
  return result + '"';
}

std::string Number(double value) {
  if (!std::isfinite(value)) return "null";
  char text[32];
  return std::string(text, std::to_chars(text, text + sizeof(text), value).ptr);
}

std::string Concat(std::initializer_list<std::string_view> parts) {
  std::string text;
  for (const std::string_view part : parts) text += part;
  return text;
}

std::string Joined(const std::vector<std::string>& items, const char* separator) {
  std::string text;
  for (const std::string& item : items) {
    if (!text.empty()) text += separator;
    text += item;
  }
  return text;
}

std::vector<int> ActiveDegrees(const ViewGraph& graph) {
  std::vector<int> degrees(graph.image_ids.size(), 0);
  for (const GraphEdge& edge : ActiveEdges(graph).edges) {
    ++degrees[edge.node1];
    ++degrees[edge.node2];
  }
  return degrees;
}

std::string EdgeToJson(const ViewEdge& edge) {
  const Eigen::Quaterniond& q = edge.cam2_from_cam1.rotation;
  const Eigen::Vector3d& t = edge.cam2_from_cam1.translation;
  return Concat({"{\"image_id1\": ",
                 std::to_string(edge.image_id1),
                 ", \"image_id2\": ",
                 std::to_string(edge.image_id2),
                 ", \"num_inliers\": ",
                 std::to_string(edge.num_inliers),
                 ", \"residual_px\": ",
                 Number(edge.residual_px),
                 ", \"triangulation_angle_deg\": ",
                 Number(edge.triangulation_angle_deg),
                 ", \"verifier\": ",
                 Quoted(edge.verifier),
                 ", \"status\": ",
                 Quoted(std::string(EdgeRemovalName(edge.removal))),
                 ", \"qvec\": [",
                 Number(q.w()),
                 ", ",
                 Number(q.x()),
                 ", ",
                 Number(q.y()),
                 ", ",
                 Number(q.z()),
                 "], \"tvec\": [",
                 Number(t.x()),
                 ", ",
                 Number(t.y()),
                 ", ",
                 Number(t.z()),
                 "]}"});
}

const char* Color(EdgeRemoval removal) {
  switch (removal) {
    case EdgeRemoval::kNone:
      return "black";
    case EdgeRemoval::kTooFewInliers:
      return "gray80";
    case EdgeRemoval::kNoPose:
      return "gray60";
    case EdgeRemoval::kTripletInconsistent:
      return "orange";
    case EdgeRemoval::kRotationInconsistent:
      return "red";
    case EdgeRemoval::kDirectionInconsistent:
      return "magenta";
    case EdgeRemoval::kOtherComponent:
      return "lightblue";
    case EdgeRemoval::kAmbiguous:
      return "purple";
    case EdgeRemoval::kWeakBridge:
    case EdgeRemoval::kModelInconsistent:
      return "brown";
  }
  return "black";
}

}  // namespace

std::string ViewGraphToJson(const ViewGraph& graph, const std::map<image_t, std::string>& names) {
  const auto components = ActiveComponents(graph);
  std::map<image_t, int> component_of;
  std::vector<std::string> component_texts;
  for (size_t c = 0; c < components.size(); ++c) {
    std::vector<std::string> ids;
    for (const image_t id : components[c]) {
      component_of[id] = static_cast<int>(c);
      ids.push_back(std::to_string(id));
    }
    component_texts.push_back(Concat({"[", Joined(ids, ", "), "]"}));
  }
  const std::vector<int> degrees = ActiveDegrees(graph);
  std::vector<std::string> images, edges, removed;
  for (size_t k = 0; k < graph.image_ids.size(); ++k) {
    const image_t id = graph.image_ids[k];
    const auto component = component_of.find(id);
    const std::string component_text =
        component == component_of.end() ? "null" : std::to_string(component->second);
    images.push_back(Concat(
        {"{\"id\": ", std::to_string(id), ", \"name\": ", Quoted(Name(id, names)),
         ", \"degree\": ", std::to_string(degrees[k]), ", \"component\": ", component_text, "}"}));
  }
  std::map<EdgeRemoval, int> counts;
  for (const ViewEdge& edge : graph.edges) {
    edges.push_back(EdgeToJson(edge));
    if (!edge.IsActive()) ++counts[edge.removal];
  }
  for (const auto& [removal, count] : counts) {
    removed.push_back(
        Concat({Quoted(std::string(EdgeRemovalName(removal))), ": ", std::to_string(count)}));
  }
  return Concat({"{\n\"images\": [\n", Joined(images, ",\n"), "\n],\n\"edges\": [\n",
                 Joined(edges, ",\n"), "\n],\n\"removed\": {", Joined(removed, ", "),
                 "},\n\"components\": [", Joined(component_texts, ", "), "]\n}\n"});
}

std::string ViewGraphToDot(const ViewGraph& graph, const std::map<image_t, std::string>& names) {
  std::string text = "graph view_graph {\n  node [shape=box, fontsize=9];\n  overlap=false;\n";
  for (const image_t id : graph.image_ids) {
    text += Concat({"  ", std::to_string(id), " [label=", Quoted(Name(id, names)), "];\n"});
  }
  for (const ViewEdge& edge : graph.edges) {
    char style[128];
    // Line width grows with the logarithm of the inliers: 15 give 1, 1500 give 3.
    const double width = std::max(0.5, std::log10(std::max(1, edge.num_inliers)) - 0.2);
    std::snprintf(style, sizeof(style), "color=%s, penwidth=%.2f%s, tooltip=\"%d %s\"",
                  Color(edge.removal), width, edge.IsActive() ? "" : ", style=dashed",
                  edge.num_inliers, std::string(EdgeRemovalName(edge.removal)).c_str());
    text += Concat({"  ", std::to_string(edge.image_id1), " -- ", std::to_string(edge.image_id2),
                    " [", style, "];\n"});
  }
  return text + "}\n";
}

}  // namespace cairn
