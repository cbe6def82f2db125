#include "pipeline/pairs/rounds.h"

#include <algorithm>
#include <set>

namespace cairn {

std::vector<image_pair_t> LikelyPairs(const std::vector<std::pair<image_pair_t, int>>& num_matches,
                                      int per_image) {
  // (fewer matches first, larger pair id first) of each image's best pairs so far.
  std::map<image_t, std::set<std::pair<int, image_pair_t>, std::greater<>>> best;
  const auto offer = [&best, per_image](image_t image, int matches, image_pair_t pair) {
    auto& ranked = best[image];
    ranked.insert({matches, ~pair});
    if (static_cast<int>(ranked.size()) > per_image) ranked.erase(std::prev(ranked.end()));
  };
  for (const auto& [pair, matches] : num_matches) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    offer(id1, matches, pair);
    offer(id2, matches, pair);
  }
  std::set<image_pair_t> likely;
  for (const auto& [image, ranked] : best) {
    for (const auto& [matches, inverted_pair] : ranked) likely.insert(~inverted_pair);
  }
  return {likely.begin(), likely.end()};
}

}  // namespace cairn
