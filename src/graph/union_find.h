#pragma once

#include <vector>

namespace cairn {

// Disjoint sets over the nodes 0 .. n-1, by size with path halving. Nearly constant time an
// operation.
class UnionFind {
 public:
  explicit UnionFind(int num_nodes);

  int size() const { return static_cast<int>(parent_.size()); }

  // The representative of the node's set. It depends on the order of the unions: use it to compare,
  // not to name.
  int Find(int node);
  // Joins two sets; false if they were one already.
  bool Union(int a, int b);
  bool Connected(int a, int b) { return Find(a) == Find(b); }
  int SizeOf(int node) { return -parent_[Find(node)]; }
  // Has memory load what Find(node) will read.
  void Prefetch(int node) const {
    const int parent = parent_[node];
    __builtin_prefetch(&parent_[parent < 0 ? node : parent]);
  }

 private:
  std::vector<int> parent_;  // of a representative: -1 times the size of its set
};

}  // namespace cairn
