#include "graph/graph.h"

#include <algorithm>
#include <functional>
#include <numeric>

#include "cairn/base/check.h"
#include "graph/union_find.h"
#include "math/sorted_order.h"

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
  std::ranges::stable_sort(components.nodes, std::greater<>(), std::ranges::size);
  components.component_of_node.resize(num_nodes);
  for (int c = 0; c < components.Num(); ++c) {
    for (const int v : components.nodes[c]) components.component_of_node[v] = c;
  }
  return components;
}

std::vector<int> MaximumSpanningForest(int num_nodes, std::span<const GraphEdge> edges,
                                       std::span<const double> weights) {
  CAIRN_CHECK_EQ(edges.size(), weights.size());
  UnionFind sets(num_nodes);
  std::vector<int> forest;
  for (const int e : SortedOrder(edges.size(), [&](int e) { return -weights[e]; })) {
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

  const auto key = [&](int node) { return -std::ssize(adjacency.EdgesOf(node)); };
  std::vector<char> seen(num_nodes, 0);
  std::vector<ForestStep> steps;
  steps.reserve(num_nodes);
  for (const int root : SortedOrder(num_nodes, key)) {
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

namespace {

// A depth-first search of every component, without recursion: chains may be long.
struct DepthFirstSearch {
  std::vector<int> node;       // by order of discovery: those below a node follow it
  std::vector<int> order;      // of discovery, of every node
  std::vector<int> low;        // earliest node that one edge reaches from those below
  std::vector<int> parent;     // -1: a root
  std::vector<int> num_below;  // with the node itself
  std::vector<int> root;

  DepthFirstSearch(int num_nodes, std::span<const GraphEdge> edges)
      : order(num_nodes, -1),
        low(num_nodes),
        parent(num_nodes, -1),
        num_below(num_nodes, 1),
        root(num_nodes) {
    const GraphAdjacency adjacency = BuildAdjacency(num_nodes, edges);
    std::vector<int> next(adjacency.begin.begin(), adjacency.begin.end() - 1);
    for (int first = 0; first < num_nodes; ++first) {
      if (order[first] >= 0) continue;
      Discover(first, first);
      for (int v = first; v >= 0;) {
        if (next[v] < adjacency.begin[v + 1]) {
          const int u = adjacency.neighbor[next[v]++];
          if (order[u] >= 0) {
            low[v] = std::min(low[v], order[u]);
            continue;
          }
          parent[u] = v;
          Discover(u, first);
          v = u;
          continue;
        }
        const int above = parent[v];
        if (above >= 0) {
          low[above] = std::min(low[above], low[v]);
          num_below[above] += num_below[v];
        }
        v = above;
      }
    }
  }

 private:
  void Discover(int v, int first) {
    order[v] = low[v] = static_cast<int>(node.size());
    root[v] = first;
    node.push_back(v);
  }
};

}  // namespace

std::vector<std::vector<int>> HingedParts(int num_nodes, std::span<const GraphEdge> edges) {
  const DepthFirstSearch search(num_nodes, edges);
  const auto with_below = [&](int v) {
    return std::span(search.node).subspan(search.order[v], search.num_below[v]);
  };
  // Visits, in spans, the smaller of the sides that v's parent joins: v's or the other one.
  const auto visit_part = [&](int v, const auto& visit) {
    const std::span<const int> all = with_below(search.root[v]), below = with_below(v);
    if (2 * below.size() < all.size()) {
      visit(below);
      return;
    }
    // What is above, with what hangs on it as well.
    const int hinge = search.parent[v];
    const std::span<const int> of_hinge = with_below(hinge);
    visit(all.first(of_hinge.data() - all.data()));
    visit(all.last(all.data() + all.size() - (of_hinge.data() + of_hinge.size())));
    for (size_t i = 1; i < of_hinge.size(); i += search.num_below[of_hinge[i]]) {
      if (search.low[of_hinge[i]] < search.order[hinge]) visit(with_below(of_hinge[i]));
    }
  };
  struct Part {
    int v;
    int first = -1;
    size_t size = 0;
  };
  std::vector<Part> found;
  for (int v = 0; v < num_nodes; ++v) {
    const int hinge = search.parent[v];
    // Without the hinge, v and what is below it are apart from the rest of the component.
    if (hinge < 0 || search.low[v] < search.order[hinge]) continue;
    Part part{v};
    visit_part(v, [&](std::span<const int> nodes) {
      if (part.size == 0 && !nodes.empty()) part.first = nodes[0];
      part.size += nodes.size();
    });
    if (part.size > 1) found.push_back(part);
  }
  // Smaller parts lie within larger ones or beside them.
  std::ranges::stable_sort(found, std::greater<>(), &Part::size);
  std::vector<char> is_taken(num_nodes, 0);
  std::vector<std::vector<int>> parts;
  for (const Part& part : found) {
    if (is_taken[part.first]) continue;
    std::vector<int>& nodes = parts.emplace_back();
    visit_part(part.v, [&](std::span<const int> some) {
      nodes.insert(nodes.end(), some.begin(), some.end());
    });
    for (const int v : nodes) is_taken[v] = 1;
  }
  return parts;
}

LoopFinder::LoopFinder(int num_nodes, std::span<const GraphEdge> edges)
    : edge_to_marked_(num_nodes, -1) {
  Neighbors neighbors(num_nodes);
  for (size_t e = 0; e < edges.size(); ++e) {
    const auto [node1, node2] = edges[e];
    if (node1 == node2) continue;
    neighbors[node1].push_back({node2, static_cast<int>(e)});
    neighbors[node2].push_back({node1, static_cast<int>(e)});
  }
  for (std::vector<Neighbor>& list : neighbors) {
    std::ranges::stable_sort(list, {}, &Neighbor::node);
    const auto is_same = [](const Neighbor& a, const Neighbor& b) { return a.node == b.node; };
    list.erase(std::unique(list.begin(), list.end(), is_same), list.end());
  }
  neighbors_ = std::make_shared<const Neighbors>(std::move(neighbors));
}

void LoopFinder::Mark(int node) {
  if (marked_ == node) return;
  if (marked_ >= 0) {
    for (const Neighbor& neighbor : (*neighbors_)[marked_]) edge_to_marked_[neighbor.node] = -1;
  }
  for (const Neighbor& neighbor : (*neighbors_)[node])
    edge_to_marked_[neighbor.node] = neighbor.edge;
  marked_ = node;
}

std::vector<LoopFinder::Corner> LoopFinder::Find(int node1, int node2, int max_corners,
                                                 int* num_all) {
  Mark(node1);
  const std::vector<Neighbor>& candidates = (*neighbors_)[node2];
  // (Each is written down, and the next one over it unless it is a corner: a branch would often go
  // astray.)
  std::vector<Corner> corners(candidates.size() + 1);
  size_t num_found = 0;
  for (const auto [node, edge2] : candidates) {
    const int edge1 = edge_to_marked_[node];
    corners[num_found] = {node, edge1, edge2};
    num_found += edge1 >= 0;
  }
  corners.resize(num_found);
  if (num_all != nullptr) *num_all = static_cast<int>(corners.size());
  const size_t num = std::min<size_t>(corners.size(), max_corners);
  for (size_t k = 0; k < num; ++k) corners[k] = corners[k * corners.size() / num];
  corners.resize(num);
  return corners;
}

}  // namespace cairn
