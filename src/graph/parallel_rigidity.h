#pragma once

#include <array>
#include <vector>

namespace cairn {

// Maximal parallel-rigid components in space: sets of nodes whose positions are determined up to
// one translation and one scale by the directions of the edges among them, for positions in general
// position. A framework in R^3 is parallel rigid iff doubling its edges contains a spanning (3,
// 4)-tight subgraph (Whiteley 1996); found by the pebble game with components (Lee and Streinu
// 2008, algorithm 4.1). Every edge lies in exactly one component, two components share at most one
// node, and an edge that no others make rigid is a component of two nodes. The order of the edges
// does not matter. O(n) for an edge that adds something, almost nothing for one within a component.
class ParallelRigidity {
 public:
  explicit ParallelRigidity(int num_nodes);

  // A new node without edges; returns its number.
  int AddNode();
  // Self-loops and edges within a component change nothing.
  void AddEdge(int node1, int node2);
  bool InOneComponent(int node1, int node2) const;
  // Largest first (more nodes; then the smaller first node), nodes sorted; nodes without an edge
  // are in none.
  std::vector<std::vector<int>> Components() const;

 private:
  // Free pebbles + outgoing edges = 3 at every node: its degrees of freedom.
  struct Node {
    std::array<int, 3> out;
    int num_out = 0;
    std::vector<int> components;
    int mark = 0;  // == stamp_: seen by the present search
  };
  struct Step {
    int node;
    int next_edge;
  };

  int Free(int node) const { return 3 - nodes_[node].num_out; }
  bool FetchPebble(int node, int other);
  void ReversePath(int end);
  void FindComponent(int node1, int node2);
  bool ReachesPebble(int node1, int node2);
  void AddComponent(std::vector<int> nodes);

  std::vector<Node> nodes_;
  std::vector<std::vector<int>> components_;  // empty: merged into a later one
  int stamp_ = 0;
  std::vector<Step> path_;
  std::vector<int> first_into_, next_into_;  // of FindComponent
};

}  // namespace cairn
