#pragma once

#include <algorithm>
#include <vector>

#include "cairn/base/types.h"

namespace cairn {

// Ascending, each once.
inline std::vector<image_pair_t> Unique(std::vector<image_pair_t> pairs) {
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  return pairs;
}

}  // namespace cairn
