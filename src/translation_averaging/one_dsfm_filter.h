#pragma once

#include <vector>

#include "translation_averaging/direction_problem.h"

namespace cairn {

// The outlier filter of 1DSfM (Wilson and Snavely 2014). On each of many random axes the directions
// put cameras before others; an order of the cameras that contradicts as few of them as can be
// found (minimum feedback arc set, greedy) shows which edges are wrong. Returns for each edge the
// length of its projections that were broken, averaged over the axes: 0 for an edge that fits, at
// most about 0.5.
std::vector<double> OneDsfmInconsistency(const DirectionProblem& problem, int num_axes,
                                         uint64_t seed, int num_threads);

}  // namespace cairn
