#include "graph/union_find.h"

#include <utility>

namespace cairn {

UnionFind::UnionFind(int num_nodes) : parent_(num_nodes, -1) {}

int UnionFind::Find(int node) {
  while (parent_[node] >= 0) {
    const int parent = parent_[node];
    if (parent_[parent] < 0) return parent;
    node = parent_[node] = parent_[parent];
  }
  return node;
}

bool UnionFind::Union(int a, int b) {
  a = Find(a);
  b = Find(b);
  if (a == b) return false;
  if (parent_[a] > parent_[b]) std::swap(a, b);  // a's set is the larger one
  parent_[a] += parent_[b];
  parent_[b] = a;
  return true;
}

}  // namespace cairn
