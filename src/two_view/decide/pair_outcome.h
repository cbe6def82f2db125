#pragma once

#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// Turns a refined essential matrix, given by any one of its poses, into a report: decides between
// its four poses, collects inliers (small error, in front of both cameras), weighs them against
// chance, classifies the pair and fills the geometry. `report` keeps its verifier and
// num_iterations.
void FinishPair(const PreparedPair& pair, const TwoViewOptions& options, const Rigid3d& pose,
                PairReport* report);

}  // namespace cairn::internal
