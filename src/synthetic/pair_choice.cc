#include "synthetic/pair_choice.h"

#include <algorithm>
#include <limits>

namespace cairn {
namespace {

// Pairs of a minimum spanning tree (Prim 1957, dense).
std::vector<size_t> SpanningTree(const PairCosts& costs) {
  const size_t n = costs.NumItems();
  std::vector<float> nearest(n, std::numeric_limits<float>::infinity());
  std::vector<size_t> parent(n, 0);
  std::vector<bool> done(n, false);
  std::vector<size_t> tree;
  size_t node = 0;
  for (size_t step = 1; step < n; ++step) {
    done[node] = true;
    size_t next = n;
    for (size_t k = 0; k < n; ++k) {
      if (done[k]) continue;
      const float cost = costs[costs.Pair(node, k)];
      if (cost < nearest[k]) {
        nearest[k] = cost;
        parent[k] = node;
      }
      if (next == n || nearest[k] < nearest[next]) next = k;
    }
    tree.push_back(costs.Pair(parent[next], next));
    node = next;
  }
  return tree;
}

}  // namespace

std::vector<bool> ChoosePairs(const PairCosts& costs, size_t num_chosen) {
  std::vector<bool> chosen(costs.NumPairs(), false);
  for (const size_t pair : SpanningTree(costs)) chosen[pair] = true;
  std::vector<size_t> others;
  for (size_t pair = 0; pair < costs.NumPairs(); ++pair) {
    if (!chosen[pair]) others.push_back(pair);
  }
  const size_t num_others = num_chosen - (costs.NumItems() - 1);
  std::nth_element(
      others.begin(), others.begin() + num_others, others.end(),
      [&](size_t a, size_t b) { return costs[a] != costs[b] ? costs[a] < costs[b] : a < b; });
  for (size_t k = 0; k < num_others; ++k) chosen[others[k]] = true;
  return chosen;
}

}  // namespace cairn
