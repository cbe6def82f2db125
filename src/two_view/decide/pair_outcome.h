#pragma once

#include <vector>

#include "two_view/decide/special_pairs.h"
#include "two_view/prepare/prepared_pair.h"
#include "two_view/search/guided_support.h"

namespace cairn::internal {

// Memory reused over pairs.
struct OutcomeScratch {
  std::vector<float> errors;
  std::vector<int32_t> inliers;
  PointPairs shifted;
  GuidedSupport support;
  std::vector<uint64_t> cells;
  SpecialPairScratch special;
};

// Turns a refined essential matrix, given by any one of its poses, into a report: decides between
// its four poses, collects inliers (small error, in front of both cameras), weighs them against
// chance, classifies the pair and fills the geometry. `report` keeps its verifier and
// num_iterations.
void FinishPair(const PairInput& input, const PreparedPair& pair, const TwoViewOptions& options,
                const Rigid3d& pose, OutcomeScratch* scratch, PairReport* report);

}  // namespace cairn::internal
