#include "two_view/decide/competing_model.h"

#include <algorithm>

#include "cairn/geometry/epipolar.h"
#include "cairn/robust/sampson_kernels.h"
#include "two_view/search/search_steps.h"

namespace cairn::internal {
namespace {

constexpr int kMaxSamples = 60;

}  // namespace

bool CompetingModelSearch::CollectRest(const PreparedPair& pair, const Eigen::Matrix3d& E) {
  constexpr double kFar = 8.0;  // thresholds: not merely the noise of the first model
  errors_.resize(pair.points.num_blocks() * PointPairs::kBlock);
  SampsonErrors(pair.points, E, errors_.data());
  indices_.clear();
  rest_.match_index.clear();
  int num_supported = 0, num_well_supported = 0;
  int num_supported_inliers = 0;
  num_well_explained_ = 0;
  for (int i = 0; i < pair.size(); ++i) {
    const bool is_supported = i < pair.NumSupported();
    const bool is_well_supported = i < pair.NumWellSupported();
    num_supported_inliers += is_supported && errors_[i] < pair.max_error_px;
    num_well_explained_ += is_well_supported && errors_[i] < pair.max_error_px;
    if (errors_[i] < kFar * pair.max_error_px) continue;
    num_supported += is_supported;
    num_well_supported += is_well_supported;
    indices_.push_back(i);
    rest_.match_index.push_back(pair.match_index[i]);
  }
  if (num_supported < options_.min_num_inliers ||
      num_supported < options_.min_competing_share * num_supported_inliers) {
    return false;
  }
  rest_.points.SetSubset(pair.points, indices_.data(), static_cast<int>(indices_.size()));
  rest_.max_error_px = pair.max_error_px;
  rest_.chance_per_px = pair.chance_per_px;
  rest_.vote_class_end = {num_well_supported, num_supported, num_supported, rest_.points.size(),
                          rest_.points.size()};
  rest_.consensus_sigmas = pair.consensus_sigmas;
  return true;
}

bool CompetingModelSearch::IsOneOfMany() const {
  // Without a model of their own they have to be as many times more.
  constexpr double kWithoutModel = 4.0;
  return rest_.NumWellSupported() >= options_.min_num_inliers &&
         rest_.NumWellSupported() >
             kWithoutModel * options_.min_competing_share * num_well_explained_;
}

FeatureMatches CompetingModelSearch::Find(const PairInput& input, const PreparedPair& pair,
                                          const Eigen::Matrix3d& E) {
  if (!CollectRest(pair, E)) return {};
  FeatureMatches matches;
  if (IsOneOfMany()) {
    for (int i = 0; i < rest_.NumWellSupported(); ++i) {
      matches.push_back(input.matches[rest_.match_index[i]]);
    }
    return matches;
  }
  search_.Reset(rest_);
  // A model with that much support is found soon.
  RunTwoAcStep(input, rest_, std::min(kMaxSamples, options_.max_affine_samples), &search_);
  const double first_score = ScoreSampson(pair.points, E, pair.max_error_px);
  if (!search_.HasEvidence() || search_.score() < options_.min_num_inliers ||
      search_.score() < options_.min_competing_share * first_score) {
    return {};
  }
  SampsonErrors(rest_.points, EssentialFromPose(search_.pose()), errors_.data());
  for (int i = 0; i < rest_.size(); ++i) {
    if (errors_[i] < rest_.max_error_px) {
      matches.push_back(input.matches[rest_.match_index[i]]);
    }
  }
  return matches;
}

}  // namespace cairn::internal
