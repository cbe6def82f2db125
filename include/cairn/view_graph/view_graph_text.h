#pragma once

#include <map>
#include <string>

#include "cairn/base/types.h"
#include "cairn/scene/view_graph.h"

namespace cairn {

// The graph as text. `names` gives images their names; an image without one is shown by its id.

// {"images": [{id, name, degree, component}], "edges": [{...}], "removed": {reason: count},
// "components": [[ids]]}
std::string ViewGraphToJson(const ViewGraph& graph, const std::map<image_t, std::string>& names);

// Graphviz: `neato -Tsvg`. Active edges are as thick as their inliers are many, removed ones dashed
// in a color a reason.
std::string ViewGraphToDot(const ViewGraph& graph, const std::map<image_t, std::string>& names);

}  // namespace cairn
