#pragma once

#include <span>
#include <vector>

#include "cairn/graph/graph.h"

namespace cairn {

// Maximal parallel-rigid components in space: sets of nodes whose positions are determined up to
// one translation and one scale by the directions of the edges among them, for positions in general
// position. A framework in R^3 is parallel rigid iff doubling its edges contains a spanning
// (3, 4)-tight subgraph (Whiteley 1996); found by the pebble game (Lee and Streinu 2008). Every
// edge lies in exactly one component, two components share at most one node, and an edge that hangs
// loosely is a component of two nodes.
// Largest first (more nodes; then the smaller first node), nodes sorted; nodes without an edge are
// in none. Self-loops are ignored. O(n^2 + m) time.
std::vector<std::vector<int>> ParallelRigidComponents(int num_nodes,
                                                      std::span<const GraphEdge> edges);

}  // namespace cairn
