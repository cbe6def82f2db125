#include "graph/union_find.h"

#include <numeric>
#include <utility>

namespace cairn {

UnionFind::UnionFind(int num_nodes) : parent_(num_nodes) {
  std::iota(parent_.begin(), parent_.end(), 0);
}

bool UnionFind::Union(int a, int b) {
  for (;;) {
    a = Find(a);
    b = Find(b);
    if (a == b) return false;
    if (a > b) std::swap(a, b);
    int root = b;
    if (At(b).compare_exchange_strong(root, a, std::memory_order_relaxed)) return true;
  }
}

}  // namespace cairn
