#pragma once

#include <memory>
#include <span>
#include <vector>

namespace cairn {

// An undirected edge between two of the nodes 0 .. n-1. Self-loops and parallel edges are allowed
// where a function does not say otherwise.
struct GraphEdge {
  int node1 = 0;
  int node2 = 0;
};

// Connected components, largest first (more nodes; then the one with the smaller first node).
struct GraphComponents {
  std::vector<int> component_of_node;
  std::vector<std::vector<int>> nodes;  // of each component, sorted

  int Num() const { return static_cast<int>(nodes.size()); }
};

// Components of the graph; a node without edges is a component of its own. O(n + m).
GraphComponents ConnectedComponents(int num_nodes, std::span<const GraphEdge> edges);

// Indices of the edges of a maximum spanning forest (Kruskal 1956), sorted. Of equal weights the
// edge with the smaller index is taken. weights.size() == edges.size(). O(m log m).
std::vector<int> MaximumSpanningForest(int num_nodes, std::span<const GraphEdge> edges,
                                       std::span<const double> weights);

// One step of a walk over a forest: `node` is reached from `parent` by `edge`. A root has parent
// and edge -1.
struct ForestStep {
  int node = 0;
  int parent = -1;
  int edge = -1;
};

// Breadth-first walk over the given edges (indices into `edges`); every node appears once, after
// its parent. Each component begins at its node of highest degree within `subset` (then smallest).
std::vector<ForestStep> WalkForest(int num_nodes, std::span<const GraphEdge> edges,
                                   std::span<const int> subset);

// Two nodes and more that a single other node joins with the rest of their component: each side of
// an articulation (Tarjan 1972) that has fewer than half of the nodes, without that node. Parts
// within others are left out. The largest first. O(n + m).
std::vector<std::vector<int>> HingedParts(int num_nodes, std::span<const GraphEdge> edges);

// For every node the edges that touch it, in increasing index: edges of node v are
// edge[begin[v]] .. edge[begin[v + 1] - 1]. A self-loop appears twice.
struct GraphAdjacency {
  std::vector<int> begin;
  std::vector<int> edge;
  std::vector<int> neighbor;  // the other end of that edge

  std::span<const int> EdgesOf(int node) const {
    return {edge.data() + begin[node], edge.data() + begin[node + 1]};
  }
  std::span<const int> NeighborsOf(int node) const {
    return {neighbor.data() + begin[node], neighbor.data() + begin[node + 1]};
  }
};
GraphAdjacency BuildAdjacency(int num_nodes, std::span<const GraphEdge> edges);

// Loops of three: the nodes that two nodes both have an edge to. Copies share the graph; each
// thread needs one.
class LoopFinder {
 public:
  LoopFinder(int num_nodes, std::span<const GraphEdge> edges);

  struct Corner {
    int node = 0;
    int edge1 = 0;  // to the first node
    int edge2 = 0;  // to the second node
  };
  // By increasing node; of parallel edges only that with the smallest index counts. At most
  // max_corners of them, spread evenly; num_all, if not null, is how many there are. O(degree of
  // the second node), and of the first one where the last call had another.
  std::vector<Corner> Find(int node1, int node2, int max_corners, int* num_all = nullptr);

 private:
  struct Neighbor {
    int node;
    int edge;
  };
  using Neighbors = std::vector<std::vector<Neighbor>>;  // of each node, sorted

  void Mark(int node);

  std::shared_ptr<const Neighbors> neighbors_;
  int marked_ = -1;
  std::vector<int> edge_to_marked_;  // of each node; -1: none
};

}  // namespace cairn
