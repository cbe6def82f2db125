#include "graph/graph.h"

#include <algorithm>
#include <numeric>

#include "cairn/base/check.h"
#include "graph/union_find.h"

namespace cairn {

GraphComponents ConnectedComponents(int num_nodes, std::span<const GraphEdge> edges) {
  UnionFind sets(num_nodes);
  for (const GraphEdge& edge : edges) sets.Union(edge.node1, edge.node2);

  GraphComponents components;
  std::vector<int> index_of_root(num_nodes, -1);
  for (int v = 0; v < num_nodes; ++v) {
    int& index = index_of_root[sets.Find(v)];
    if (index < 0) {
      index = components.Num();
      components.nodes.emplace_back();
    }
    components.nodes[index].push_back(v);
  }
  // They were found in the order of their first nodes, which a stable sort keeps.
  std::stable_sort(components.nodes.begin(), components.nodes.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  components.component_of_node.resize(num_nodes);
  for (int c = 0; c < components.Num(); ++c) {
    for (const int v : components.nodes[c]) components.component_of_node[v] = c;
  }
  return components;
}

std::vector<int> MaximumSpanningForest(int num_nodes, std::span<const GraphEdge> edges,
                                       std::span<const double> weights) {
  CAIRN_CHECK_EQ(edges.size(), weights.size());
  std::vector<int> order(edges.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return weights[a] > weights[b]; });
  UnionFind sets(num_nodes);
  std::vector<int> forest;
  for (const int e : order) {
    if (sets.Union(edges[e].node1, edges[e].node2)) forest.push_back(e);
  }
  std::sort(forest.begin(), forest.end());
  return forest;
}

GraphAdjacency BuildAdjacency(int num_nodes, std::span<const GraphEdge> edges) {
  GraphAdjacency adjacency;
  adjacency.begin.assign(num_nodes + 1, 0);
  for (const GraphEdge& edge : edges) {
    ++adjacency.begin[edge.node1 + 1];
    ++adjacency.begin[edge.node2 + 1];
  }
  std::partial_sum(adjacency.begin.begin(), adjacency.begin.end(), adjacency.begin.begin());
  adjacency.edge.resize(2 * edges.size());
  adjacency.neighbor.resize(2 * edges.size());
  std::vector<int> next(adjacency.begin.begin(), adjacency.begin.end() - 1);
  const auto add = [&](int node, int neighbor, int edge) {
    adjacency.edge[next[node]] = edge;
    adjacency.neighbor[next[node]++] = neighbor;
  };
  for (size_t e = 0; e < edges.size(); ++e) {
    add(edges[e].node1, edges[e].node2, static_cast<int>(e));
    add(edges[e].node2, edges[e].node1, static_cast<int>(e));
  }
  return adjacency;
}

std::vector<ForestStep> WalkForest(int num_nodes, std::span<const GraphEdge> edges,
                                   std::span<const int> subset) {
  std::vector<GraphEdge> subset_edges;
  subset_edges.reserve(subset.size());
  for (const int e : subset) subset_edges.push_back(edges[e]);
  const GraphAdjacency adjacency = BuildAdjacency(num_nodes, subset_edges);

  std::vector<int> roots(num_nodes);
  std::iota(roots.begin(), roots.end(), 0);
  std::stable_sort(roots.begin(), roots.end(), [&](int a, int b) {
    return adjacency.EdgesOf(a).size() > adjacency.EdgesOf(b).size();
  });
  std::vector<char> seen(num_nodes, 0);
  std::vector<ForestStep> steps;
  steps.reserve(num_nodes);
  for (const int root : roots) {
    if (seen[root]) continue;
    seen[root] = 1;
    steps.push_back({root, -1, -1});
    for (size_t next = steps.size() - 1; next < steps.size(); ++next) {
      const int parent = steps[next].node;
      for (int k = adjacency.begin[parent]; k < adjacency.begin[parent + 1]; ++k) {
        const int node = adjacency.neighbor[k];
        if (seen[node]) continue;
        seen[node] = 1;
        steps.push_back({node, parent, subset[adjacency.edge[k]]});
      }
    }
  }
  return steps;
}

std::vector<int> Bridges(int num_nodes, std::span<const GraphEdge> edges) {
  const GraphAdjacency adjacency = BuildAdjacency(num_nodes, edges);
  std::vector<int> bridges;
  std::vector<int> order(num_nodes, -1);  // of discovery
  std::vector<int> low(num_nodes);        // earliest node reachable by one back edge
  std::vector<int> next(adjacency.begin.begin(), adjacency.begin.end() - 1);
  std::vector<int> edge_to(num_nodes, -1);
  int num_found = 0;
  std::vector<int> stack;  // depth-first search without recursion: chains may be long
  for (int root = 0; root < num_nodes; ++root) {
    if (order[root] >= 0) continue;
    stack.push_back(root);
    order[root] = low[root] = num_found++;
    while (!stack.empty()) {
      const int v = stack.back();
      if (next[v] < adjacency.begin[v + 1]) {
        const int e = adjacency.edge[next[v]];
        const int u = adjacency.neighbor[next[v]++];
        if (e == edge_to[v] || u == v) continue;
        if (order[u] >= 0) {
          low[v] = std::min(low[v], order[u]);
        } else {
          order[u] = low[u] = num_found++;
          edge_to[u] = e;
          stack.push_back(u);
        }
        continue;
      }
      stack.pop_back();
      if (stack.empty()) break;
      low[stack.back()] = std::min(low[stack.back()], low[v]);
      if (low[v] > order[stack.back()]) bridges.push_back(edge_to[v]);
    }
  }
  std::sort(bridges.begin(), bridges.end());
  return bridges;
}

LoopFinder::LoopFinder(int num_nodes, std::span<const GraphEdge> edges) : neighbors_(num_nodes) {
  for (size_t e = 0; e < edges.size(); ++e) {
    const auto [node1, node2] = edges[e];
    if (node1 == node2) continue;
    neighbors_[node1].push_back({node2, static_cast<int>(e)});
    neighbors_[node2].push_back({node1, static_cast<int>(e)});
  }
  for (std::vector<Neighbor>& list : neighbors_) {
    std::stable_sort(list.begin(), list.end(),
                     [](const Neighbor& a, const Neighbor& b) { return a.node < b.node; });
    const auto is_same = [](const Neighbor& a, const Neighbor& b) { return a.node == b.node; };
    list.erase(std::unique(list.begin(), list.end(), is_same), list.end());
  }
}

std::vector<LoopFinder::Corner> LoopFinder::Find(int node1, int node2, int max_corners,
                                                 int* num_all) const {
  std::vector<Corner> corners;
  auto a = neighbors_[node1].begin();
  auto b = neighbors_[node2].begin();
  while (a != neighbors_[node1].end() && b != neighbors_[node2].end()) {
    if (a->node == b->node) corners.push_back({a->node, a->edge, b->edge});
    const bool advance_a = a->node <= b->node;
    const bool advance_b = b->node <= a->node;
    a += advance_a;
    b += advance_b;
  }
  if (num_all != nullptr) *num_all = static_cast<int>(corners.size());
  const size_t num = std::min<size_t>(corners.size(), max_corners);
  for (size_t k = 0; k < num; ++k) corners[k] = corners[k * corners.size() / num];
  corners.resize(num);
  return corners;
}

}  // namespace cairn
