#include "two_view/search/guided_support.h"

#include <algorithm>
#include <cmath>

namespace cairn::internal {
namespace {

// The share of right ones among matches of which `num_near` of `num` are near the model, where
// chance puts the share `chance` of wrong ones: by Laplace's rule of succession, where what is
// known beforehand weighs as two matches. Never surer than kMaxShare.
double ShareOfRight(double num_near, double num, double chance, double expected) {
  constexpr double kMaxShare = 0.99;
  const double num_right = (num_near - chance * num) / (1.0 - chance);
  return std::clamp((num_right + 2.0 * expected) / (num + 2.0), 1.0 - kMaxShare, kMaxShare);
}

}  // namespace

double NoiseScalePx(const PreparedPair& pair, std::span<const float> errors_px, double factor) {
  constexpr double kNumParameters = 5.0;  // of a pose
  constexpr double kPriorWeight = 10.0;   // matches
  constexpr double kPriorNoise = 0.5;     // thresholds
  constexpr double kMaxNoise = 1.5;       // thresholds
  const double prior_noise_px = kPriorNoise * pair.max_error_px;
  const double max_noise_px = kMaxNoise * pair.max_error_px;
  std::vector<float> small;
  small.reserve(errors_px.size());
  for (const float error : errors_px) {
    if (error < max_noise_px) small.push_back(error);
  }
  const double by_chance = pair.chance_per_px * max_noise_px * pair.size();
  const double num_right = static_cast<double>(small.size()) - by_chance;
  if (!(num_right > 2.0 * kNumParameters)) return prior_noise_px;
  const auto middle = small.begin() + static_cast<ptrdiff_t>(0.5 * num_right);
  std::nth_element(small.begin(), middle, small.end());
  const double noise_px = factor * (1.0 + 5.0 / (num_right - kNumParameters)) * *middle;
  const double mean_square =
      (kPriorWeight * prior_noise_px * prior_noise_px + num_right * noise_px * noise_px) /
      (kPriorWeight + num_right);
  return std::min(std::sqrt(mean_square), max_noise_px);
}

void GuidedSupport::Learn(const PreparedPair& pair, std::span<const float> errors_px,
                          double reach_px) {
  constexpr double kNear = 3.0;  // sigmas: 99.7 % of normal errors
  sigma_px_ = NoiseScalePx(pair, errors_px, kSigmaOfMedian);
  const double near_px = kNear * sigma_px_;
  const double chance = std::min(0.5, pair.chance_per_px * near_px);
  auto count_near = [&](int begin, int end) {
    return std::count_if(errors_px.begin() + begin, errors_px.begin() + end,
                         [near_px](float error) { return error < near_px; });
  };
  const double share_of_all =
      ShareOfRight(static_cast<double>(count_near(0, pair.size())), pair.size(), chance, 0.0);
  // Densities of right and of wrong matches at no error.
  const double peak = std::sqrt(2.0 / M_PI) / sigma_px_ / pair.chance_per_px;
  classes_.clear();
  std::vector<int32_t> indices;
  int begin = 0;
  for (int c = 0; c < PreparedPair::kNumVoteClasses; ++c) {
    const int end = pair.vote_class_end[c];
    indices.clear();
    for (int i = begin; i < end; ++i) {
      if (errors_px[i] < reach_px) indices.push_back(i);
    }
    if (!indices.empty()) {
      const double share = ShareOfRight(static_cast<double>(count_near(begin, end)), end - begin,
                                        chance, share_of_all);
      points_[c].SetSubset(pair.points, indices.data(), static_cast<int>(indices.size()));
      classes_.push_back({&points_[c], scale_px(), std::log1p(share / (1.0 - share) * peak)});
    }
    begin = end;
  }
}

double GuidedSupport::Score(const Eigen::Matrix3d& E) const {
  double score = 0.0;
  for (const WeightedPoints& c : classes_) {
    score += c.weight * SoftScoreSampson(*c.points, E, c.scale_px);
  }
  return score;
}

Rigid3d GuidedSupport::Refine(const Rigid3d& start) const {
  return RefinePose(classes_, start,
                    {.loss = RobustLoss::kGemanMcClure, .min_relative_gain = 1e-4});
}

}  // namespace cairn::internal
