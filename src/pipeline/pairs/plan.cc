#include "pipeline/pairs/plan.h"

#include <algorithm>
#include <functional>
#include <tuple>

namespace cairn {
namespace {

int64_t BytesOf(const std::map<image_t, int64_t>& image_bytes, image_t id) {
  const auto it = image_bytes.find(id);
  return it == image_bytes.end() ? 0 : it->second;
}

// Group number of every image, by filling groups with consecutive ids.
std::map<image_t, int> GroupImages(const std::set<image_t>& images,
                                   const std::map<image_t, int64_t>& image_bytes,
                                   int64_t max_group_bytes) {
  std::map<image_t, int> groups;
  int group = 0;
  int64_t bytes = 0;
  for (const image_t id : images) {
    const int64_t more = BytesOf(image_bytes, id);
    if (bytes > 0 && bytes + more > max_group_bytes) {
      ++group;
      bytes = 0;
    }
    bytes += more;
    groups[id] = group;
  }
  return groups;
}

PairTile MakeTile(std::vector<image_pair_t> pairs) {
  const std::set<image_t> images = ImagesOf(pairs);
  std::map<image_t, size_t> blocks;
  for (const image_t id : images) {
    const size_t position = blocks.size();
    blocks[id] = position / kBlockImages;
  }
  std::vector<std::tuple<size_t, size_t, image_pair_t>> ordered;
  for (const image_pair_t pair : pairs) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    ordered.emplace_back(blocks.at(id1), blocks.at(id2), pair);
  }
  std::sort(ordered.begin(), ordered.end());
  for (size_t i = 0; i < pairs.size(); ++i) pairs[i] = std::get<2>(ordered[i]);
  return {{images.begin(), images.end()}, std::move(pairs)};
}

}  // namespace

std::set<image_t> ImagesOf(const std::vector<image_pair_t>& pairs) {
  std::set<image_t> images;
  for (const image_pair_t pair : pairs) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    images.insert({id1, id2});
  }
  return images;
}

std::vector<PairTile> PlanPairTiles(const std::vector<image_pair_t>& pairs,
                                    const std::map<image_t, int64_t>& image_bytes,
                                    int64_t max_bytes) {
  const std::set<image_t> images = ImagesOf(pairs);
  const std::map<image_t, int> groups = GroupImages(images, image_bytes, max_bytes / 2);
  // (row, column or its negative in odd rows) sorts tiles in serpentine order.
  std::map<std::pair<int, int>, std::vector<image_pair_t>> tiles;
  for (const image_pair_t pair : pairs) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    const int row = groups.at(id1);
    const int column = groups.at(id2);
    tiles[{row, row % 2 == 0 ? column : -column}].push_back(pair);
  }
  std::vector<PairTile> plan;
  for (auto& [key, tile_pairs] : tiles) {
    plan.push_back(MakeTile(std::move(tile_pairs)));
  }
  return plan;
}

std::vector<image_pair_t> LikelyPairs(const std::vector<std::pair<image_pair_t, int>>& num_matches,
                                      int per_image) {
  // (more matches first, smaller pair id first) of each image's best pairs so far.
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
