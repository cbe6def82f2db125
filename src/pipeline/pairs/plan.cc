#include "pipeline/pairs/plan.h"

#include <algorithm>
#include <set>
#include <utility>

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

}  // namespace

std::vector<PairTile> PlanPairTiles(const std::vector<image_pair_t>& pairs,
                                    const std::map<image_t, int64_t>& image_bytes,
                                    int64_t max_bytes) {
  std::set<image_t> images;
  for (const image_pair_t pair : pairs) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    images.insert({id1, id2});
  }
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
    std::sort(tile_pairs.begin(), tile_pairs.end());
    std::set<image_t> tile_images;
    for (const image_pair_t pair : tile_pairs) {
      const auto [id1, id2] = PairIdToImagePair(pair);
      tile_images.insert({id1, id2});
    }
    plan.push_back({{tile_images.begin(), tile_images.end()}, std::move(tile_pairs)});
  }
  return plan;
}

}  // namespace cairn
