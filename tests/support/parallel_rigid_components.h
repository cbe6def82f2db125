#pragma once

#include "graph/graph.h"
#include "graph/parallel_rigidity.h"

namespace cairn {

inline std::vector<std::vector<int>> ParallelRigidComponents(int num_nodes,
                                                             std::span<const GraphEdge> edges) {
  ParallelRigidity rigidity(num_nodes);
  for (const GraphEdge& edge : edges) rigidity.AddEdge(edge.node1, edge.node2);
  return rigidity.Components();
}

}  // namespace cairn
