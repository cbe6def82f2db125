#include "pipeline/verification_rounds.h"

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

void LearnDepthVotes(Database& database, const std::vector<image_pair_t>& likely_pairs) {
  const std::map<image_t, DepthVotes> known = database.ReadImageDepthVotes();
  std::map<image_t, DepthVotes> learned;
  for (const auto& [pair, votes] : database.ReadPairDepthVotes()) {
    if (!std::binary_search(likely_pairs.begin(), likely_pairs.end(), pair)) continue;
    const auto [id1, id2] = PairIdToImagePair(pair);
    for (const image_t id : {id1, id2}) {
      learned[id].num_hypotheses += votes.num_hypotheses;
      learned[id].num_right += votes.num_right;
    }
  }
  Database::Transaction transaction(database);
  for (const auto& [id, votes] : learned) {
    if (known.count(id) == 0) database.WriteImageDepthVotes(id, votes);
  }
  transaction.Commit();
}

}  // namespace cairn
