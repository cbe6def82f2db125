#pragma once

#include "two_view/calibrated_verifier.h"
#include "two_view/decide/competing_model.h"
#include "two_view/decide/pair_outcome.h"
#include "two_view/search/pose_search.h"
#include "two_view/search/search_steps.h"
#include "two_view/search/triangle_step.h"

namespace cairn::internal {

// Which steps a search takes, in this order.
struct CascadeSteps {
  bool one_ac_depth = true;
  bool triangles = true;
  bool two_ac = true;
  bool five_point = true;
};

// The cascade and the parts of it: cheap and mostly sufficient first, each step only while evidence
// is missing.
class CascadeVerifier : public CalibratedVerifier {
 public:
  CascadeVerifier(const CascadeSteps& steps, std::string_view name, const TwoViewOptions& options)
      : steps_(steps), name_(name), options_(options), search_(options), competing_(options) {}
  PairReport Verify(const PairInput& input) override;
  const PreparedPair* pair_by_consensus() const override { return &pair_; }

 private:
  // Can one of the 1AC+D hypotheses be expected to be right, or is no other step to follow?
  void Resample(const PairInput& input);
  // Takes the pose from a pair that has a second model as good (COLMAP's kMultiple).
  void MarkCompeting(const PairInput& input, PairReport* report);

  CascadeSteps steps_;
  std::string_view name_;
  TwoViewOptions options_;
  PreparedPair pair_;
  OneAcDepthStep one_ac_depth_;
  TriangleDepthStep triangles_;
  PoseSearch search_;
  CompetingModelSearch competing_;
  OutcomeScratch scratch_;
};

}  // namespace cairn::internal
