#pragma once

#include <map>
#include <vector>

#include "database/match_origins.h"

namespace cairn {

// All pairs of images with descriptors, without those that another program decided about.
std::vector<image_pair_t> ExhaustivePairs(const std::map<image_t, int>& num_descriptors,
                                          const MatchOrigins& origins);

// Seconds that one core takes to match and verify all of these.
double ExhaustiveSeconds(const std::map<image_t, int>& num_descriptors,
                         const MatchOrigins& origins);

}  // namespace cairn
