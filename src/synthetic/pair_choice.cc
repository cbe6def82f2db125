#include "synthetic/pair_choice.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "graph/graph.h"

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

std::vector<size_t> ChoosePairs(size_t num_items, std::span<const CandidatePair> candidates,
                                size_t num_chosen) {
  std::vector<GraphEdge> edges;
  std::vector<double> weights;
  for (const CandidatePair& pair : candidates) {
    edges.push_back({pair.item1, pair.item2});
    weights.push_back(-pair.cost);
  }
  std::vector<char> is_first(candidates.size(), 0);
  for (const int e : MaximumSpanningForest(static_cast<int>(num_items), edges, weights)) {
    is_first[e] = 1;
  }
  std::vector<size_t> order(candidates.size());
  std::iota(order.begin(), order.end(), size_t{0});
  const auto less = [&](size_t a, size_t b) {
    if (is_first[a] != is_first[b]) return is_first[a] > is_first[b];
    return candidates[a].cost != candidates[b].cost ? candidates[a].cost < candidates[b].cost
                                                    : a < b;
  };
  if (num_chosen < order.size()) {
    std::nth_element(order.begin(), order.begin() + static_cast<int64_t>(num_chosen), order.end(),
                     less);
    order.resize(num_chosen);
  }
  std::sort(order.begin(), order.end());
  return order;
}

}  // namespace cairn
