#pragma once

#include <memory>
#include <optional>

#include "two_view/calibrated_verifier.h"
#include "two_view/decide/focal_evidence.h"
#include "two_view/search/fundamental_search.h"

namespace cairn::internal {

// Adds to a verifier of calibrated pairs what it cannot know: whether the focal lengths are right.
// A pair with a camera of unknown focal length gets a fundamental matrix and the config
// kUncalibrated; where the guessed focal length explains far less than that matrix, those that the
// matrix proposes are tried, and the pose is that of the best. A pair of trusted cameras keeps its
// essential matrix, unless the fundamental one explains far more: then it is kUncalibrated, too.
class FocalVerifier : public PairVerifier {
 public:
  // searches: a fundamental matrix is sought where the calibrated verifier finds nothing, too.
  FocalVerifier(std::unique_ptr<CalibratedVerifier> calibrated, bool searches,
                const TwoViewOptions& options)
      : calibrated_(std::move(calibrated)),
        searches_(searches),
        options_(options),
        weigher_(options) {}
  PairReport Verify(const PairInput& input) override;

 private:
  void Prepare(const PairInput& input);
  std::optional<FundamentalModel> Find(const PairInput& input, const PairReport& report) const;
  // Does F explain matches off the plane of this homography (pixels), more than by chance?
  bool HasParallax(const PairInput& input, const FundamentalModel& model,
                   const Eigen::Matrix3d& H) const;
  PairReport TryFocals(const PairInput& input, const PairReport& guess, const Eigen::Matrix3d& F);
  void Fill(const PairInput& input, const FundamentalModel& model, PairReport* report) const;

  std::unique_ptr<CalibratedVerifier> calibrated_;
  const bool searches_;
  TwoViewOptions options_;
  FocalWeigher weigher_;
  const PreparedPair* pair_ = nullptr;  // own, or the calibrated verifier's until it is used again
  PreparedPair own_pair_;
};

}  // namespace cairn::internal
