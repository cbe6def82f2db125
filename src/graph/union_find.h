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
  int SizeOf(int node) { return size_[Find(node)]; }

 private:
  std::vector<int> parent_;
  std::vector<int> size_;
};

}  // namespace cairn
