#include "cairn/graph/parallel_rigidity.h"

#include <algorithm>
#include <array>
#include <utility>

namespace cairn {
namespace {

constexpr int kPebbles = 3;  // k: a node's degrees of freedom
constexpr int kGauge = 4;    // l: translation and scale

// The (3, 4)-pebble game with detection of components (Lee and Streinu 2008, algorithm 4.1).
// Invariant: free pebbles + outgoing edges = 3 at every node.
class PebbleGame {
 public:
  explicit PebbleGame(int num_nodes)
      : num_nodes_(num_nodes),
        out_(num_nodes),
        num_out_(num_nodes, 0),
        components_of_(num_nodes),
        mark_(num_nodes, 0) {}

  void AddEdge(int u, int v) {
    for (int copy = 0; copy < 2 && !InOneComponent(u, v); ++copy) {
      while (Free(u) + Free(v) < kGauge + 1) {
        if (!FetchPebble(u, v) && !FetchPebble(v, u)) return;  // dependent: adds nothing
      }
      out_[u][num_out_[u]++] = v;
      FindComponent(u, v);
    }
  }

  std::vector<std::vector<int>> TakeComponents() {
    std::erase_if(components_, [](const auto& nodes) { return nodes.empty(); });
    return std::move(components_);
  }

 private:
  int Free(int v) const { return kPebbles - num_out_[v]; }

  bool InOneComponent(int u, int v) const {
    for (const int a : components_of_[u]) {
      for (const int b : components_of_[v]) {
        if (a == b) return true;
      }
    }
    return false;
  }

  // Brings a free pebble to u from a node reachable from it, leaving those on u and v alone.
  bool FetchPebble(int u, int v) {
    if (Free(u) == kPebbles) return false;
    ++stamp_;
    mark_[u] = mark_[v] = stamp_;
    path_.assign(1, {u, 0});
    while (!path_.empty()) {
      Step& step = path_.back();
      if (step.next_edge == num_out_[step.node]) {
        path_.pop_back();
        continue;
      }
      const int w = out_[step.node][step.next_edge++];
      if (mark_[w] == stamp_) continue;
      mark_[w] = stamp_;
      if (Free(w) > 0) {
        ReversePath(w);
        return true;
      }
      path_.push_back({w, 0});
    }
    return false;
  }

  // Turns round the edges along path_ and on to its end, which pays with a pebble.
  void ReversePath(int end) {
    for (size_t k = path_.size(); k-- > 0;) {
      const int node = path_[k].node;
      out_[end][num_out_[end]++] = node;
      out_[node][path_[k].next_edge - 1] = out_[node][--num_out_[node]];
      end = node;
    }
  }

  // After an edge u -> v: the component it completes, if it does. It is the set of all nodes from
  // which no free pebble can be reached, other than the four on u and v.
  void FindComponent(int u, int v) {
    if (Free(u) + Free(v) > kGauge || ReachesPebble(u, v)) return;
    std::vector<std::vector<int>> incoming(num_nodes_);
    std::vector<int> queue;
    ++stamp_;
    for (int w = 0; w < num_nodes_; ++w) {
      for (int k = 0; k < num_out_[w]; ++k) incoming[out_[w][k]].push_back(w);
      if (w != u && w != v && Free(w) > 0) {
        mark_[w] = stamp_;
        queue.push_back(w);
      }
    }
    for (size_t k = 0; k < queue.size(); ++k) {
      for (const int w : incoming[queue[k]]) {
        if (mark_[w] == stamp_) continue;
        mark_[w] = stamp_;
        queue.push_back(w);
      }
    }
    std::vector<int> nodes;
    for (int w = 0; w < num_nodes_; ++w) {
      if (mark_[w] != stamp_) nodes.push_back(w);
    }
    AddComponent(std::move(nodes));
  }

  bool ReachesPebble(int u, int v) {
    ++stamp_;
    mark_[u] = mark_[v] = stamp_;
    std::vector<int> queue = {u, v};
    for (size_t k = 0; k < queue.size(); ++k) {
      for (int j = 0; j < num_out_[queue[k]]; ++j) {
        const int w = out_[queue[k]][j];
        if (mark_[w] == stamp_) continue;
        mark_[w] = stamp_;
        if (Free(w) > 0) return true;
        queue.push_back(w);
      }
    }
    return false;
  }

  // A component swallows every older one that shares two nodes with it.
  void AddComponent(std::vector<int> nodes) {
    const int id = static_cast<int>(components_.size());
    std::vector<int> num_shared(id, 0);
    for (const int v : nodes) {
      for (const int c : components_of_[v]) ++num_shared[c];
    }
    for (const int v : nodes) {
      std::erase_if(components_of_[v], [&](int c) { return num_shared[c] >= 2; });
      components_of_[v].push_back(id);
    }
    for (int c = 0; c < id; ++c) {
      if (num_shared[c] >= 2) components_[c].clear();
    }
    components_.push_back(std::move(nodes));
  }

  struct Step {
    int node;
    int next_edge;
  };

  int num_nodes_;
  std::vector<std::array<int, kPebbles>> out_;
  std::vector<int> num_out_;
  std::vector<std::vector<int>> components_of_;
  std::vector<std::vector<int>> components_;
  std::vector<int> mark_;  // == stamp_: seen by the present search
  int stamp_ = 0;
  std::vector<Step> path_;
};

}  // namespace

std::vector<std::vector<int>> ParallelRigidComponents(int num_nodes,
                                                      std::span<const GraphEdge> edges) {
  PebbleGame game(num_nodes);
  for (const GraphEdge& edge : edges) {
    if (edge.node1 != edge.node2) game.AddEdge(edge.node1, edge.node2);
  }
  std::vector<std::vector<int>> components = game.TakeComponents();
  std::sort(components.begin(), components.end(), [](const auto& a, const auto& b) {
    return a.size() != b.size() ? a.size() > b.size() : a < b;
  });
  return components;
}

}  // namespace cairn
