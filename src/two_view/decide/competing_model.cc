#include "two_view/decide/competing_model.h"

#include <algorithm>

#include "robust/match_errors.h"
#include "two_view/search/search_steps.h"

namespace cairn::internal {
namespace {

// Of matches that a model explains, or of those that it does not.
struct Counts {
  int num_supported = 0;       // any vote
  int num_well_supported = 0;  // of these

  Counts(const PreparedPair& pair, std::span<const int32_t> indices)
      : num_supported(NumBefore(indices, pair.NumSupported())),
        num_well_supported(NumBefore(indices, pair.NumWellSupported())) {}

 private:
  static int NumBefore(std::span<const int32_t> indices, int end) {
    return static_cast<int>(std::lower_bound(indices.begin(), indices.end(), end) -
                            indices.begin());
  }
};

std::vector<int32_t> Unexplained(const MatchErrors& errors, double max_error_px) {
  std::vector<int32_t> indices;
  for (int i = 0; i < std::ssize(errors.values()); ++i) {
    if (!(errors[i] < kOutside * max_error_px)) indices.push_back(i);
  }
  return indices;
}

}  // namespace

FeatureMatches FindCompetingModel(const PreparedPair& pair, const Eigen::Matrix3d& E,
                                  const TwoViewOptions& options) {
  const MatchErrors errors(pair.points, E);
  const Counts explained(pair, errors.Below(pair.max_error_px));
  const std::vector<int32_t> unexplained = Unexplained(errors, pair.max_error_px);
  const Counts others(pair, unexplained);
  if (others.num_supported < options.min_num_inliers ||
      others.num_supported < options.min_competing_share * explained.num_supported) {
    return {};
  }
  // Without a model of their own they have to be as many times more.
  constexpr double kWithoutModel = 4.0;
  if (others.num_well_supported >= options.min_num_inliers &&
      others.num_well_supported >
          kWithoutModel * options.min_competing_share * explained.num_well_supported) {
    return pair.Matches(std::span(unexplained).first(others.num_well_supported));
  }
  const PreparedPair rest = pair.Subset(unexplained);
  PoseSearch search(rest, options);
  // A model with that much support is found soon.
  constexpr int kMaxSamples = 60;
  RunTwoAcStep(rest, std::min(kMaxSamples, options.max_affine_samples), &search);
  const double first_score = ScoreSampson(pair.points, E, pair.max_error_px);
  if (!search.HasEvidence() || search.best().score < options.min_num_inliers ||
      search.best().score < options.min_competing_share * first_score) {
    return {};
  }
  return rest.Matches(MatchErrors(rest.points, search.best().E).Below(rest.max_error_px));
}

}  // namespace cairn::internal
