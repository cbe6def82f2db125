#pragma once

#include <vector>

#include "cairn/two_view/pair_verifier.h"
#include "two_view/pair_outcome.h"
#include "two_view/prepared_pair.h"

namespace cairn::internal {

// One affine correspondence with depth per hypothesis: every match gives one pose; the best
// supported ones are refined from a wide to the final threshold (METHOD.md section 4).
class OneAcDepthVerifier : public PairVerifier {
 public:
  explicit OneAcDepthVerifier(const TwoViewOptions& options) : options_(options) {}
  PairReport Verify(const PairInput& input) override;

 private:
  struct Hypothesis {
    Rigid3d pose;
    double support = 0.0;
  };

  // Fills hypotheses_, best soft support first.
  void GenerateHypotheses(const PairInput& input);

  TwoViewOptions options_;
  PreparedPair pair_;
  OutcomeScratch scratch_;
  std::vector<Hypothesis> hypotheses_;
};

}  // namespace cairn::internal
