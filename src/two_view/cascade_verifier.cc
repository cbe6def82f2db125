#include "two_view/cascade_verifier.h"

#include <cmath>

#include "cairn/base/rng.h"

namespace cairn::internal {
namespace {

constexpr int kMaxTrianglesRefined = 24;

}  // namespace

PairReport CascadeVerifier::Verify(const PairInput& input) {
  PairReport report;
  report.verifier = name_;
  if (static_cast<int>(input.matches.size()) < options_.min_num_matches) {
    report.status = PairStatus::kTooFewMatches;
    return report;
  }
  PreparePair(input, options_, MatchOrder::kByConsensus, &pair_);
  search_.Reset(pair_);
  const bool has_depth = steps_.one_ac_depth && !input.depth1.empty() && !input.depth2.empty();
  // Without depth more rests on the other steps.
  constexpr double kWithoutDepth = 3.0;
  const double share =
      std::min(1.0, options_.unsupported_budget * (has_depth ? 1.0 : kWithoutDepth));
  auto budget = [&](int full) {
    return pair_.IsSupported() ? full : static_cast<int>(std::ceil(share * full));
  };
  int num_with_depth = 0;
  if (has_depth) {
    num_with_depth = one_ac_depth_.Run(input, pair_, budget(options_.max_num_refined), &search_);
    if (search_.HasConverged()) report.verifier = "one_ac_depth";
  }
  if (steps_.triangles && has_depth && !search_.HasConverged()) {
    triangles_.Run(input, pair_, options_.max_depth_triangles, kMaxTrianglesRefined, &search_);
    if (search_.HasConverged()) report.verifier = "triangles";
  }
  if (steps_.two_ac && !search_.HasConverged()) {
    RunTwoAcStep(input, pair_, budget(options_.max_affine_samples), &search_);
    if (search_.HasConverged()) report.verifier = "two_ac";
  }
  if (steps_.five_point && !search_.HasConverged()) {
    RunFivePointStep(input, pair_, budget(options_.max_fallback_samples), &search_);
    if (search_.HasConverged()) report.verifier = "five_point";
  }
  if (search_.HasEvidence() && options_.num_resamples > 0) Resample(input);
  report.num_iterations = search_.num_hypotheses();
  if (!search_.HasModel()) {
    const bool only_depth = steps_.one_ac_depth && !steps_.two_ac && !steps_.five_point;
    report.status = only_depth && num_with_depth == 0 ? PairStatus::kNoDepth : PairStatus::kNoModel;
    return report;
  }
  FinishPair(input, pair_, options_, search_.pose(), &scratch_, &report);
  if (report.geometry.config == TwoViewConfig::kCalibrated) MarkCompeting(input, &report);
  return report;
}

void CascadeVerifier::MarkCompeting(const PairInput& input, PairReport* report) {
  TwoViewGeometry& geometry = report->geometry;
  const FeatureMatches others = competing_.Find(input, pair_, *geometry.E);
  if (others.empty()) return;
  geometry.inlier_matches.insert(geometry.inlier_matches.end(), others.begin(), others.end());
  geometry.config = TwoViewConfig::kMultiple;
  geometry.cam2_from_cam1.reset();
  geometry.E.reset();
  geometry.F.reset();
  report->num_inliers = static_cast<int>(geometry.inlier_matches.size());
}

void CascadeVerifier::Resample(const PairInput& input) {
  auto resample = PoseSearch::ThoroughResampling(options_);
  if (!steps_.five_point) resample.num_refined = resample.patience = 2;
  Rng rng(input.seed, "resample", input.pair_id);
  search_.Resample(resample, &rng);
}

}  // namespace cairn::internal
