#pragma once

#include <array>
#include <vector>

#include "cairn/robust/pose_refinement.h"
#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// How well poses near a roughly right one explain the matches of a pair. Matches come in classes,
// by the votes of their neighbours; which share of a class is right is learned from the errors at
// the rough pose, and a match counts by the logarithm of its odds to be right, given that it fits:
// one that nobody bears out has to fit no less well, but is no reason to move the pose far from
// others (Tordoff and Murray, "Guided-MLESAC: faster image transform estimation by using matching
// priors", PAMI 2005). The loss is smooth, at the scale of the pair's noise.
class GuidedSupport {
 public:
  // errors_px: of all matches at the rough pose; those of reach_px and more are left out.
  void Learn(const PreparedPair& pair, const std::vector<float>& errors_px, double reach_px);

  double Score(const Eigen::Matrix3d& E) const;  // larger is better
  Rigid3d Refine(const Rigid3d& start) const;

 private:
  std::array<PointPairs, PreparedPair::kNumVoteClasses> points_;
  std::vector<WeightedPoints> classes_;  // those that have points
  std::vector<float> scratch_;
  std::vector<int32_t> indices_;
};

}  // namespace cairn::internal
