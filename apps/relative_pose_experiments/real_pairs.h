#pragma once

#include <string>
#include <vector>

#include "relative_pose_experiments/real_scene.h"
#include "relative_pose_experiments/statistics.h"
#include "relative_pose_experiments/table.h"

namespace cairn::experiments {

// One pair and estimator of the paper's Figure 6.
struct PairResult {
  const RealPair* pair = nullptr;
  std::string estimator;
  bool has_pose = false;  // a verifier may also reject the pair; then the errors are 180 degrees
  PoseErrors errors = {};
  int num_inliers = 0;
  int64_t num_iterations = 0;
  double ms = 0;  // the least of three runs
};

// "1AC+D" and "5PT" are the paper's comparison (paper_estimator.h); the others are cairn's
// verifiers with the options given and the paper's threshold, if theirs is the automatic one.
inline const std::vector<std::string> kRealEstimators = {"1AC+D", "5PT", "one_ac_depth",
                                                         "five_point", "cascade"};

// Runs every estimator on every pair, one pair after the other, so that times mean something.
std::vector<PairResult> RunRealPairs(const RealScene& scene, const TwoViewOptions& verification,
                                     uint64_t seed, ProgressMonitor& monitor);
// "pairs": a row a pair and estimator; "pair_timings": times apart, as they are not deterministic;
// "pairs_summary": a row an estimator. Checks are for the synthetic scene.
Results TabulatePairs(const std::vector<PairResult>& results, const RealDataOptions& data);

// The paper's appendix: what one correspondence alone gives.
struct SingleReport {
  int64_t num_matches = 0;        // of all pairs: the denominator of all shares
  double share_six_inliers = 0;   // at least six correspondences agree, itself among them
  double share_within_20_15 = 0;  // rotation within 20 and translation within 15 degrees
  double share_within_10_10 = 0;
  // Of the hypotheses: matches with depth that the solver does not reject.
  std::vector<double> rotation_deg, translation_deg;
};
SingleReport RunSingleCorrespondences(const RealScene& scene, int num_threads);
// "single": the shares; "single_distribution": shares of all correspondences with an error below 1,
// 2, ... 180 degrees. Checks are for the synthetic scene.
Results TabulateSingle(const SingleReport& report, const RealDataOptions& data);

}  // namespace cairn::experiments
