#include "graph/union_find.h"

#include <numeric>
#include <utility>

namespace cairn {

UnionFind::UnionFind(int num_nodes) : parent_(num_nodes), size_(num_nodes, 1) {
  std::iota(parent_.begin(), parent_.end(), 0);
}

int UnionFind::Find(int node) {
  while (parent_[node] != node) {
    parent_[node] = parent_[parent_[node]];
    node = parent_[node];
  }
  return node;
}

bool UnionFind::Union(int a, int b) {
  a = Find(a);
  b = Find(b);
  if (a == b) return false;
  if (size_[a] < size_[b]) std::swap(a, b);
  parent_[b] = a;
  size_[a] += size_[b];
  return true;
}

}  // namespace cairn
