#pragma once

#include <optional>

#include "two_view/calibrated_verifier.h"
#include "two_view/search/fundamental_search.h"

namespace cairn::internal {

// Adds to the verification of calibrated pairs what it cannot know: whether the focal lengths are
// right. A pair with a camera of unknown focal length gets a fundamental matrix and the config
// kUncalibrated; its pose is that of the guess, if that gives one. A pair of trusted cameras keeps
// its essential matrix, unless the fundamental one explains far more: then it is kUncalibrated,
// too.
class FocalVerifier : public PairVerifier {
 public:
  // searches: a fundamental matrix is sought where the calibrated verifier finds nothing, too.
  FocalVerifier(const SearchSteps& steps, bool searches, const TwoViewOptions& options)
      : steps_(steps), searches_(searches), options_(options) {}
  PairReport Verify(const PairInput& input) override;

 private:
  PairReport VerifyMatches(const PairInput& input);
  // Where most inliers lie over the photographs: what the other matches show, if that moves against
  // these.
  PairReport LookUnderOverlay(const PairInput& input, PairReport report);
  // Is there to be a search for F, after what was found by the focal lengths as they are?
  bool NeedsFundamental(const PairReport& report) const;
  // Decides between the report and a fundamental matrix.
  PairReport Judge(PairReport report) const;
  std::optional<FundamentalModel> Find(const PairReport& report) const;
  std::optional<FundamentalModel> FindFromNothing() const;
  void Fill(const FundamentalModel& model, PairReport* report) const;

  const SearchSteps steps_;
  const bool searches_;
  const TwoViewOptions options_;
  PreparedPair pair_;  // that is being verified
};

}  // namespace cairn::internal
