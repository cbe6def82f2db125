#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "cairn/base/types.h"

namespace cairn {

// Verification goes over the pairs in two rounds. The first has the likely pairs: those among the
// most-matched ones of either image. They give a connected view graph early, and what is learned of
// cameras from them the second round then knows. The rounds are fixed sets, so that a pair's result
// depends on no order of work.

// Of `num_matches` (ascending by pair), the pairs that are among the `per_image` with the most
// matches of one of their images, ascending; of equal ones the smaller pair id comes first.
std::vector<image_pair_t> LikelyPairs(const std::vector<std::pair<image_pair_t, int>>& num_matches,
                                      int per_image);

}  // namespace cairn
