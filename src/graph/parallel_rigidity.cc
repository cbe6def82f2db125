#include "graph/parallel_rigidity.h"

#include <algorithm>
#include <utility>

namespace cairn {
namespace {

constexpr int kGauge = 4;  // l: translation and scale

}  // namespace

ParallelRigidity::ParallelRigidity(int num_nodes) : nodes_(num_nodes) {}

int ParallelRigidity::AddNode() {
  nodes_.emplace_back();
  return static_cast<int>(nodes_.size()) - 1;
}

// Both copies of the edge; each needs five pebbles on its ends and takes one.
void ParallelRigidity::AddEdge(int u, int v) {
  for (int copy = 0; copy < 2 && u != v && !InOneComponent(u, v); ++copy) {
    while (Free(u) + Free(v) < kGauge + 1) {
      if (!FetchPebble(u, v) && !FetchPebble(v, u)) return;  // dependent: adds nothing
    }
    nodes_[u].out[nodes_[u].num_out++] = v;
    FindComponent(u, v);
  }
}

bool ParallelRigidity::InOneComponent(int u, int v) const {
  for (const int a : nodes_[u].components) {
    for (const int b : nodes_[v].components) {
      if (a == b) return true;
    }
  }
  return false;
}

// Brings a free pebble to u from a node reachable from it, leaving those on u and v alone.
bool ParallelRigidity::FetchPebble(int u, int v) {
  if (Free(u) == 3) return false;
  ++stamp_;
  nodes_[u].mark = nodes_[v].mark = stamp_;
  path_.assign(1, {u, 0});
  while (!path_.empty()) {
    Step& step = path_.back();
    if (step.next_edge == nodes_[step.node].num_out) {
      path_.pop_back();
      continue;
    }
    const int w = nodes_[step.node].out[step.next_edge++];
    if (nodes_[w].mark == stamp_) continue;
    nodes_[w].mark = stamp_;
    if (Free(w) > 0) {
      ReversePath(w);
      return true;
    }
    path_.push_back({w, 0});
  }
  return false;
}

// Turns round the edges along path_ and on to its end, which pays with a pebble.
void ParallelRigidity::ReversePath(int end) {
  for (size_t k = path_.size(); k-- > 0;) {
    Node& node = nodes_[path_[k].node];
    nodes_[end].out[nodes_[end].num_out++] = path_[k].node;
    node.out[path_[k].next_edge - 1] = node.out[--node.num_out];
    end = path_[k].node;
  }
}

// After an edge u -> v: the component it completes, if it does. It is the set of all nodes from
// which no free pebble can be reached, other than the four on u and v.
void ParallelRigidity::FindComponent(int u, int v) {
  if (Free(u) + Free(v) > kGauge || ReachesPebble(u, v)) return;
  const int num_nodes = static_cast<int>(nodes_.size());
  // The edges into a node as a list; edge 3 w + k leaves w.
  first_into_.assign(num_nodes, -1);
  next_into_.resize(3 * num_nodes);
  std::vector<int> queue;
  ++stamp_;
  for (int w = 0; w < num_nodes; ++w) {
    for (int k = 0; k < nodes_[w].num_out; ++k) {
      const int edge = 3 * w + k;
      next_into_[edge] = std::exchange(first_into_[nodes_[w].out[k]], edge);
    }
    if (w != u && w != v && Free(w) > 0) {
      nodes_[w].mark = stamp_;
      queue.push_back(w);
    }
  }
  for (size_t k = 0; k < queue.size(); ++k) {
    for (int edge = first_into_[queue[k]]; edge >= 0; edge = next_into_[edge]) {
      const int w = edge / 3;
      if (nodes_[w].mark == stamp_) continue;
      nodes_[w].mark = stamp_;
      queue.push_back(w);
    }
  }
  std::vector<int> component;
  for (int w = 0; w < num_nodes; ++w) {
    if (nodes_[w].mark != stamp_) component.push_back(w);
  }
  AddComponent(std::move(component));
}

bool ParallelRigidity::ReachesPebble(int u, int v) {
  ++stamp_;
  nodes_[u].mark = nodes_[v].mark = stamp_;
  std::vector<int> queue = {u, v};
  for (size_t k = 0; k < queue.size(); ++k) {
    for (int j = 0; j < nodes_[queue[k]].num_out; ++j) {
      const int w = nodes_[queue[k]].out[j];
      if (nodes_[w].mark == stamp_) continue;
      nodes_[w].mark = stamp_;
      if (Free(w) > 0) return true;
      queue.push_back(w);
    }
  }
  return false;
}

// A component swallows every older one that shares two nodes with it.
void ParallelRigidity::AddComponent(std::vector<int> members) {
  const int id = static_cast<int>(components_.size());
  std::vector<int> num_shared(id, 0);
  for (const int v : members) {
    for (const int c : nodes_[v].components) ++num_shared[c];
  }
  for (const int v : members) {
    std::erase_if(nodes_[v].components, [&](int c) { return num_shared[c] >= 2; });
    nodes_[v].components.push_back(id);
  }
  for (int c = 0; c < id; ++c) {
    if (num_shared[c] >= 2) components_[c].clear();
  }
  components_.push_back(std::move(members));
}

std::vector<std::vector<int>> ParallelRigidity::Components() const {
  std::vector<std::vector<int>> components = components_;
  std::erase_if(components, [](const auto& nodes) { return nodes.empty(); });
  std::sort(components.begin(), components.end(), [](const auto& a, const auto& b) {
    return a.size() != b.size() ? a.size() > b.size() : a < b;
  });
  return components;
}

}  // namespace cairn
