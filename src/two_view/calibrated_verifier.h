#pragma once

#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// How a pose is searched for: the steps, in this order, each only while evidence is missing.
struct SearchSteps {
  std::string_view name;  // of them all
  bool one_ac_depth = true;
  bool triangles = true;
  bool two_ac = true;
  bool five_point = true;
  // The votes of neighbours order the matches and set the budgets; without, five points have
  // TwoViewOptions::max_iterations.
  bool uses_votes = true;
};

// Searches the pose of a prepared pair and decides what the pair is, by the focal lengths as they
// are.
PairReport VerifyCalibrated(const PreparedPair& pair, const SearchSteps& steps,
                            const TwoViewOptions& options);

}  // namespace cairn::internal
