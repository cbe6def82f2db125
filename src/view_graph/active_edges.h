#pragma once

#include <algorithm>
#include <vector>

#include "cairn/scene/view_graph.h"
#include "graph/graph.h"

namespace cairn {

// The edges in use, over nodes 0 .. n-1 in the order of graph.image_ids.
struct ActiveEdges {
  std::vector<GraphEdge> edges;
  std::vector<int> index;  // of each in graph.edges

  explicit ActiveEdges(const ViewGraph& graph) {
    for (size_t e = 0; e < graph.edges.size(); ++e) {
      if (!graph.edges[e].IsActive()) continue;
      edges.push_back(
          {NodeOf(graph, graph.edges[e].image_id1), NodeOf(graph, graph.edges[e].image_id2)});
      index.push_back(static_cast<int>(e));
    }
  }

  static int NodeOf(const ViewGraph& graph, image_t id) {
    const auto& ids = graph.image_ids;
    return static_cast<int>(std::lower_bound(ids.begin(), ids.end(), id) - ids.begin());
  }
};

}  // namespace cairn
