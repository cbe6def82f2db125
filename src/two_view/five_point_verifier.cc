#include "two_view/five_point_verifier.h"

#include "cairn/base/rng.h"
#include "cairn/solvers/essential.h"
#include "two_view/essential_estimator.h"

namespace cairn::internal {

PairReport FivePointVerifier::Verify(const PairInput& input) {
  PairReport report;
  report.verifier = "five_point";
  if (static_cast<int>(input.matches.size()) < options_.min_num_matches) {
    report.status = PairStatus::kTooFewMatches;
    return report;
  }
  PreparePair(input, options_, MatchOrder::kRandom, &pair_);
  FivePointEstimator estimator(pair_);
  RansacOptions ransac_options;
  ransac_options.confidence = options_.confidence;
  ransac_options.min_iterations = options_.min_iterations;
  ransac_options.max_iterations = options_.max_iterations;
  Rng rng(input.seed, "five_point", input.pair_id);
  const auto ransac = Ransac(estimator, ransac_options, rng);
  report.num_iterations = ransac.num_iterations;
  if (ransac.status == RansacStatus::kNoModel || ransac.status == RansacStatus::kTooFewSamples) {
    report.status = PairStatus::kNoModel;
    return report;
  }
  const EssentialDecomposition parts = DecomposeEssential(ransac.model);
  search_.Reset(pair_);
  search_.AddRefined(Rigid3d(parts.R1, parts.t));
  if (search_.HasEvidence() && options_.num_resamples > 0) {
    PoseSearch::ResampleOptions resample;
    resample.num_samples = options_.num_resamples;
    search_.Resample(resample, &rng);
  }
  FinishPair(input, pair_, options_, search_.pose(), &scratch_, &report);
  return report;
}

}  // namespace cairn::internal
