#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "cairn/base/types.h"

namespace cairn {

// Of 1024 pairs that follow each other, most are of 64 images: so many, or a little more, go to one
// machine together, and few images with them (machines/helpers.h).
inline constexpr size_t kBlockImages = 32;

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

}  // namespace cairn
