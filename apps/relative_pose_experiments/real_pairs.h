#pragma once

#include <string>
#include <vector>

#include "relative_pose_experiments/paper_estimator.h"
#include "relative_pose_experiments/real_scene.h"
#include "relative_pose_experiments/table.h"

namespace cairn::experiments {

// One pair and estimator of the paper's Figure 6.
struct PairResult {
  const RealPair* pair = nullptr;
  std::string estimator;
  bool has_pose = false;  // a verifier may also reject the pair; then the errors are 180 degrees
  RelativeErrors errors = {};
  int num_inliers = 0;
  int64_t num_iterations = 0;
  double ms = 0;  // the least of three runs
};

// "1AC+D" and "5PT" are the paper's comparison (paper_estimator.h); the others are cairn's
// verifiers with the options given and the paper's threshold, if theirs is the automatic one.
inline const std::vector<std::string> kRealEstimators = {"1AC+D", "5PT", "one_ac_depth",
                                                         "five_point", "cascade"};

// Runs every estimator on every pair, one pair after the other, so that times mean something.
std::vector<PairResult> RunRealPairs(const RealScene& scene, TwoViewOptions verification,
                                     uint64_t seed, ProgressMonitor& monitor);

// A row a pair and estimator; a row an estimator; times apart, as they are not deterministic.
Table PairTable(const std::vector<PairResult>& results, const RealDataOptions& data);
Table PairSummaryTable(const std::vector<PairResult>& results, const RealDataOptions& data);
Table PairTimeTable(const std::vector<PairResult>& results, const RealDataOptions& data);
// For the synthetic scene.
std::vector<FigureCheck> Checks(const std::vector<PairResult>& results);

// The paper's appendix: what one correspondence alone gives.
struct SingleReport {
  int64_t num_matches = 0;        // of all pairs: the denominator of all shares
  int64_t num_hypotheses = 0;     // with depth, and not rejected by the solver
  double share_six_inliers = 0;   // at least six correspondences agree, itself among them
  double share_within_20_15 = 0;  // rotation within 20 and translation within 15 degrees
  double share_within_10_10 = 0;
  std::vector<double> rotation_deg, translation_deg;  // of the hypotheses
};
SingleReport RunSingleCorrespondences(const RealScene& scene, int num_threads);
std::vector<FigureCheck> Checks(const SingleReport& report);
Table SingleSummaryTable(const SingleReport& report, const RealDataOptions& data);
// Share of all correspondences with an error below 1, 2, ... 180 degrees.
Table SingleDistributionTable(const SingleReport& report, const RealDataOptions& data);

}  // namespace cairn::experiments
