#pragma once

#include <optional>

#include "cairn/two_view/pair_verifier.h"
#include "two_view/prepare/prepared_pair.h"

namespace cairn::experiments {

enum class MinimalSolver { kFivePoint, kOneAffineDepth };

// The paper's comparison on real pairs: two minimal solvers in one and the same robust estimator,
// LO-RANSAC with MSAC over the Sampson error, the number of iterations by the confidence and the
// share of inliers, and one local optimization for both (nonlinear, with a shrinking scale). The
// paper has GC-RANSAC with eight points as local optimization, and its default values, of which the
// fewest iterations matter here. The report has a status, pose, and numbers of inliers and
// iterations.
PairReport EstimateAsPaper(const PairInput& input, MinimalSolver solver);

// The matches in normalized coordinates, in their own order, with the paper's threshold: 0.05 % of
// the mean image diagonal.
internal::PreparedPair PrepareAsPaper(PairInput input);

// By 1AC+D from match i of the prepared pair, |t| = 1; absent without depth, or if the solver
// rejects the sample.
std::optional<Rigid3d> PoseFromOne(const internal::PreparedPair& pair, int i);

}  // namespace cairn::experiments
