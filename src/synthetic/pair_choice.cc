#include "synthetic/pair_choice.h"

#include <algorithm>
#include <numeric>

#include "graph/graph.h"

namespace cairn {
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
    std::ranges::nth_element(order, order.begin() + static_cast<int64_t>(num_chosen), less);
    order.resize(num_chosen);
  }
  std::sort(order.begin(), order.end());
  return order;
}

}  // namespace cairn
