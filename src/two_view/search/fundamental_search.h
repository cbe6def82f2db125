#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "robust/ransac.h"
#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// What a fundamental matrix explains; it needs no focal length.
struct FundamentalModel {
  Eigen::Matrix3d F;             // of the pair's normalized points
  std::vector<int32_t> inliers;  // indices into pair.points
  double log10_nfa = 0.0;        // against chance, see evidence.h
};

// Improves F (an essential matrix at wrong focal lengths will do) on all matches: normalized
// eight-point fits with a shrinking threshold. Absent if too few matches support it.
std::optional<FundamentalModel> RefineFundamental(const PreparedPair& pair,
                                                  const Eigen::Matrix3d& start);

// Seven-point LO-RANSAC (Hartley and Zisserman, 11.1.2) over the matches with consensus first.
std::optional<FundamentalModel> FindFundamental(const PreparedPair& pair,
                                                const RansacOptions& options);

// A better one near it or beyond (see fundamental_resampling.h). Takes about 3 milliseconds.
std::optional<FundamentalModel> ImproveFundamental(const PreparedPair& pair,
                                                   const Eigen::Matrix3d& start);

}  // namespace cairn::internal
