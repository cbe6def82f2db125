#pragma once

#include <vector>

#include "cairn/scene/view_graph.h"
#include "graph/graph.h"
#include "math/sorted_order.h"

namespace cairn {

// The edges in use, over nodes 0 .. n-1 in the order of graph.image_ids.
struct ActiveEdges {
  std::vector<GraphEdge> edges;
  std::vector<int> index;  // of each in graph.edges

  explicit ActiveEdges(const ViewGraph& graph) {
    for (size_t e = 0; e < graph.edges.size(); ++e) {
      const ViewEdge& edge = graph.edges[e];
      if (!edge.IsActive()) continue;
      edges.push_back(
          {IndexIn(graph.image_ids, edge.image_id1), IndexIn(graph.image_ids, edge.image_id2)});
      index.push_back(static_cast<int>(e));
    }
  }
};

}  // namespace cairn
