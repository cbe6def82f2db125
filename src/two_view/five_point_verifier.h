#pragma once

#include "two_view/calibrated_verifier.h"
#include "two_view/pair_outcome.h"
#include "two_view/pose_search.h"
#include "two_view/prepared_pair.h"

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
