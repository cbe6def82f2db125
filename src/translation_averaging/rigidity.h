#pragma once

#include <vector>

#include "translation_averaging/direction_problem.h"

namespace cairn {

// The largest set of cameras whose positions the directions determine, up to one translation and
// one scale and for positions in general position, sorted. Points of tracks
// count as nodes of their own, where they join cameras that edges alone leave loose.
std::vector<int> LargestPlaceableSet(const DirectionProblem& problem,
                                     const std::vector<char>& edge_is_out);

}  // namespace cairn
