#pragma once

#include "two_view/calibrated_verifier.h"
#include "two_view/decide/pair_outcome.h"
#include "two_view/prepare/prepared_pair.h"
#include "two_view/search/pose_search.h"

namespace cairn::internal {

// Locally optimized RANSAC over five points: needs neither depth nor affine frames.
class FivePointVerifier : public CalibratedVerifier {
 public:
  explicit FivePointVerifier(const TwoViewOptions& options) : options_(options), search_(options) {}
  PairReport Verify(const PairInput& input) override;

 private:
  TwoViewOptions options_;
  PreparedPair pair_;
  PoseSearch search_;
  OutcomeScratch scratch_;
};

}  // namespace cairn::internal
