#include "two_view/five_point_verifier.h"

#include "cairn/base/rng.h"
#include "two_view/search/search_steps.h"

namespace cairn::internal {

PairReport FivePointVerifier::Verify(const PairInput& input) {
  PairReport report;
  report.verifier = "five_point";
  if (static_cast<int>(input.matches.size()) < options_.min_num_matches) {
    report.status = PairStatus::kTooFewMatches;
    return report;
  }
  PreparePair(input, options_, MatchOrder::kGiven, &pair_);
  search_.Reset(pair_);
  RunFivePointStep(input, pair_, options_.max_iterations, &search_);
  if (search_.HasEvidence() && options_.num_resamples > 0) {
    Rng rng(input.seed, "resample", input.pair_id);
    search_.Resample(PoseSearch::ThoroughResampling(options_), &rng);
  }
  report.num_iterations = search_.num_hypotheses();
  if (!search_.HasModel()) {
    report.status = PairStatus::kNoModel;
    return report;
  }
  FinishPair(input, pair_, options_, search_.pose(), &scratch_, &report);
  return report;
}

}  // namespace cairn::internal
