#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace cairn {

// Two of some items, and what it costs to choose them as a pair.
struct CandidatePair {
  int item1 = 0, item2 = 0;
  float cost = 0;
};

// The pairs of a minimum spanning forest and the cheapest others, num_chosen in all: indices of
// candidates, sorted; all of them where there are fewer.
std::vector<size_t> ChoosePairs(size_t num_items, std::span<const CandidatePair> candidates,
                                size_t num_chosen);

}  // namespace cairn
