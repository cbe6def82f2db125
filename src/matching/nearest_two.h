#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "cairn/scene/features.h"

namespace cairn {

inline constexpr int32_t kNoNeighbor = std::numeric_limits<int32_t>::max();

// Squared Euclidean distances to the nearest and second nearest descriptor; kNoNeighbor where there
// is none. Of equally near ones the smaller index is the nearest.
struct NearestTwo {
  int32_t best = kNoNeighbor;
  int32_t second = kNoNeighbor;
  int32_t index = -1;
  bool operator==(const NearestTwo&) const = default;
};

// For every descriptor of `columns` its nearest two among `rows`; in the same pass for every
// descriptor of `rows` the distances to its nearest two among `columns` (index is left at -1).
// All have 128 elements. Integer arithmetic throughout: the same on every SIMD target.
void FindNearestTwo(const Descriptors& rows, const Descriptors& columns,
                    std::vector<NearestTwo>* column_neighbors,
                    std::vector<NearestTwo>* row_neighbors);

}  // namespace cairn
