#pragma once

#include <Eigen/Core>
#include <vector>

#include "translation_averaging/direction_problem.h"

namespace cairn {

// Cameras so far out that they can only have been thrown there: their nearest neighbor is a
// thousand times as far as neighbors are (the median over the edges). Many cameras in one place,
// by a tripod, are no reason to leave others out: pairs of theirs have no direction.
std::vector<int> ThrownAway(const DirectionProblem& problem, const Eigen::Matrix3Xd& centers);

}  // namespace cairn
