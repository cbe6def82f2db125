#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "cairn/base/types.h"

namespace cairn {

// Of 1024 pairs that follow each other, most are of 64 images: so many, or a little more, go to one
// machine together, and few images with them (machines/helpers.h).
inline constexpr size_t kBlockImages = 32;

std::set<image_t> ImagesOf(const std::vector<image_pair_t>& pairs);

// Pairs that are done while the features of `images` are in memory.
struct PairTile {
  std::vector<image_t> images;      // sorted
  std::vector<image_pair_t> pairs;  // in blocks of kBlockImages by kBlockImages images
};

// Orders pairs so that every image is loaded few times with at most max_bytes of image data in
// memory at once: consecutive images form groups of at most max_bytes / 2, and a tile has the pairs
// between two groups. Tiles follow each other in serpentine order, so that neighbors share a group.
// Images that are absent from image_bytes count nothing. A single pair may exceed the limit, since
// it must be done.
std::vector<PairTile> PlanPairTiles(const std::vector<image_pair_t>& pairs,
                                    const std::map<image_t, int64_t>& image_bytes,
                                    int64_t max_bytes);

// The pairs of the first of verification's two rounds, which are likely to be verified: they give a
// connected view graph early, and the second round knows what is learned of cameras from them. The
// rounds are fixed sets, so that a pair's result depends on no order of work.
//
// Of `num_matches` (ascending by pair), those among the `per_image` pairs with the most matches of
// one of their images; of equal ones the smaller pair id comes first. Ascending.
std::vector<image_pair_t> LikelyPairs(const std::vector<std::pair<image_pair_t, int>>& num_matches,
                                      int per_image);

}  // namespace cairn
