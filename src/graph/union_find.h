#pragma once

#include <atomic>
#include <vector>

namespace cairn {

// The root above a node, where parent_of(node) is an std::atomic_ref<int>, a root's being itself.
// Halves the path: another thread may have found a parent nearer to the root meanwhile, but what is
// stored is above the node, too.
template <class ParentOf>
int FindRoot(int node, const ParentOf& parent_of) {
  for (;;) {
    const int parent = parent_of(node).load(std::memory_order_relaxed);
    const int grandparent = parent_of(parent).load(std::memory_order_relaxed);
    if (parent == grandparent) return parent;
    parent_of(node).store(grandparent, std::memory_order_relaxed);
    node = grandparent;
  }
}

// Disjoint sets over the nodes 0 .. n-1. Threads may join and find at the same time, without locks
// (Anderson and Woll, "Wait-free parallel algorithms for the union-find problem", STOC 1991): a
// parent is smaller than its child, and paths are halved.
class UnionFind {
 public:
  explicit UnionFind(int num_nodes);

  int size() const { return static_cast<int>(parent_.size()); }

  // The smallest node of the set, whatever the order of the unions; while others join, one of its
  // nodes.
  int Find(int node) {
    return FindRoot(node, [this](int n) { return At(n); });
  }
  // Joins two sets; false if they were one already.
  bool Union(int a, int b);
  // Has memory load what Find(node) will read.
  void Prefetch(int node) {
    __builtin_prefetch(&parent_[At(node).load(std::memory_order_relaxed)]);
  }

 private:
  std::atomic_ref<int> At(int node) { return std::atomic_ref<int>(parent_[node]); }

  std::vector<int> parent_;  // of a representative: itself
};

}  // namespace cairn
