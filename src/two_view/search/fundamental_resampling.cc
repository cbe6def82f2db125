#include "two_view/search/fundamental_resampling.h"

#include <algorithm>

#include "cairn/math/so3.h"
#include "cairn/robust/sampson_kernels.h"
#include "cairn/solvers/homography.h"
#include "cairn/solvers/seven_point.h"
#include "two_view/decide/focal_plausibility.h"
#include "two_view/search/pair_noise.h"

namespace cairn::internal {
namespace {

constexpr int kNumSamples = 20;  // of each kind, a round
constexpr int kNumRefined = 4;   // a round
constexpr int kMaxNumRounds = 10, kPatience = 4;
constexpr double kGain = 1.005;       // of the support: less is no progress
constexpr double kImplausible = 0.5;  // what support without plausible focal lengths is worth

}  // namespace

Eigen::Matrix3d FundamentalResampling::Run(const Eigen::Matrix3d& start, Rng* rng) {
  constexpr int kFewPoints = 256;
  supported_.SetPrefix(pair_.points, pair_.IsSupported() ? pair_.NumSupported() : 0);
  const FundamentalRefinementOptions rough{
      .scale_px = pair_.max_error_px, .max_iterations = 10, .min_relative_gain = 1e-3};
  Eigen::Matrix3d best = start;
  int num_stale_rounds = 0;
  double sigma_px = pair_.max_error_px;
  for (int round = 0; round < kMaxNumRounds && num_stale_rounds < kPatience; ++round) {
    FindExplained(best);
    constexpr double kSigmaOfMedian = 1.4826;  // of normal errors
    sigma_px = NoiseScalePx(pair_, errors_, kSigmaOfMedian, &scratch_);
    const double support_before = SupportAt(best, sigma_px);
    double best_support = support_before;
    hypotheses_.clear();
    SampleSeven(rng);
    SamplePlaneAndParallax(rng);
    const int num_refined = ChooseHypotheses(kNumRefined);
    for (int k = 0; k < num_refined; ++k) {
      const Eigen::Matrix3d F = Refine(hypotheses_[k].F, rough, kFewPoints);
      const double support = SupportAt(F, sigma_px);
      if (!(support > best_support)) continue;
      best_support = support;
      best = F;
    }
    num_stale_rounds = best_support < kGain * support_before ? num_stale_rounds + 1 : 0;
  }
  FindExplained(best);
  constexpr double kScaleOfMedian = 2.0;  // 1.35 sigmas
  return Refine(best, {.scale_px = NoiseScalePx(pair_, errors_, kScaleOfMedian, &scratch_)},
                pair_.size());
}

double FundamentalResampling::SupportAt(const Eigen::Matrix3d& F, double sigma_px) const {
  const double support =
      SoftScoreSampson(pair_.points, F, sigma_px) + SoftScoreSampson(supported_, F, sigma_px);
  return HasPlausibleFocals(F, camera1_, camera2_) ? support : kImplausible * support;
}

int FundamentalResampling::ChooseHypotheses(int max_count) {
  constexpr int kMaxTried = 12;
  auto by_support = [](const Hypothesis& a, const Hypothesis& b) { return a.support > b.support; };
  const auto num_tried = std::min<ptrdiff_t>(kMaxTried, std::ssize(hypotheses_));
  const auto end = hypotheses_.begin() + num_tried;
  std::partial_sort(hypotheses_.begin(), end, hypotheses_.end(), by_support);
  std::stable_partition(hypotheses_.begin(), end, [this](const Hypothesis& hypothesis) {
    return HasPlausibleFocals(hypothesis.F, camera1_, camera2_);
  });
  return static_cast<int>(std::min<ptrdiff_t>(max_count, num_tried));
}

void FundamentalResampling::FindExplained(const Eigen::Matrix3d& F) {
  constexpr double kExplained = 2.0;  // thresholds
  errors_.resize(pair_.points.num_blocks() * PointPairs::kBlock);
  SampsonErrors(pair_.points, F, errors_.data());
  explained_.clear();
  for (int i = 0; i < pair_.size(); ++i) {
    if (errors_[i] < kExplained * pair_.max_error_px) explained_.push_back(i);
  }
}

void FundamentalResampling::SampleSeven(Rng* rng) {
  constexpr int kSampleSize = SevenPoint::kSampleSize;
  const auto n = static_cast<uint32_t>(explained_.size());
  if (n < kSampleSize) return;
  Eigen::Matrix3d models[SevenPoint::kMaxSolutions];
  for (int k = 0; k < kNumSamples; ++k) {
    uint32_t sample[kSampleSize];
    rng->Sample(n, kSampleSize, sample);
    PointCorrespondence points[kSampleSize];
    for (int m = 0; m < kSampleSize; ++m) {
      const int i = explained_[sample[m]];
      points[m] = {pair_.points.Point1(i), pair_.points.Point2(i)};
    }
    const int count = SevenPoint::Solve(points, models);
    for (int m = 0; m < count; ++m) Add(models[m]);
  }
}

void FundamentalResampling::FindPlane(Rng* rng) {
  constexpr int kSampleSize = HomographyFourPoint::kSampleSize;
  constexpr int kNumPlaneSamples = 20;
  const double max_error_px = 2.0 * pair_.max_error_px;
  const auto n = static_cast<uint32_t>(explained_.size());
  off_plane_.clear();
  if (n < kSampleSize) return;
  near_.SetSubset(pair_.points, explained_.data(), static_cast<int>(n));
  double best = 0.0;
  for (int k = 0; k < kNumPlaneSamples; ++k) {
    uint32_t sample[kSampleSize];
    rng->Sample(n, kSampleSize, sample);
    PointCorrespondence points[kSampleSize];
    for (int m = 0; m < kSampleSize; ++m) {
      points[m] = {near_.Point1(sample[m]), near_.Point2(sample[m])};
    }
    Eigen::Matrix3d H;
    if (HomographyFourPoint::Solve(points, &H) == 0) continue;
    const double score = ScoreHomography(near_, H, max_error_px);
    if (score > best) {
      best = score;
      H_ = H;
    }
  }
  if (best == 0.0) return;
  for (int round = 0; round < 2; ++round) {
    scratch_.resize(near_.num_blocks() * PointPairs::kBlock);
    HomographyErrors(near_, H_, scratch_.data());
    std::vector<PointCorrespondence> on_plane;
    for (int i = 0; i < near_.size(); ++i) {
      if (scratch_[i] < max_error_px) on_plane.push_back({near_.Point1(i), near_.Point2(i)});
    }
    Eigen::Matrix3d H;
    if (!HomographyFromPoints(on_plane, &H) || ScoreHomography(near_, H, max_error_px) < best) {
      break;
    }
    best = ScoreHomography(near_, H, max_error_px);
    H_ = H;
  }
  // Of all matches: what F does not explain may be right.
  scratch_.resize(pair_.points.num_blocks() * PointPairs::kBlock);
  HomographyErrors(pair_.points, H_, scratch_.data());
  const int num_candidates = supported_.size() > 0 ? supported_.size() : pair_.size();
  for (int i = 0; i < num_candidates; ++i) {
    if (scratch_[i] > 2.0 * max_error_px) off_plane_.push_back(i);
  }
}

void FundamentalResampling::SamplePlaneAndParallax(Rng* rng) {
  FindPlane(rng);
  const auto n = static_cast<uint32_t>(off_plane_.size());
  if (n < 2) return;
  constexpr int kNumPairs = 5 * kNumSamples;
  for (int k = 0; k < kNumPairs; ++k) {
    uint32_t sample[2];
    rng->Sample(n, 2, sample);
    Eigen::Vector3d lines[2];
    for (int m = 0; m < 2; ++m) {
      const int i = off_plane_[sample[m]];
      lines[m] = pair_.points.Point2(i).homogeneous().cross(
          Eigen::Vector3d(H_ * pair_.points.Point1(i).homogeneous()));
    }
    const Eigen::Vector3d epipole = lines[0].cross(lines[1]);
    if (epipole.norm() > 0.0) Add(CrossMatrix(epipole.normalized()) * H_);
  }
}

void FundamentalResampling::Add(const Eigen::Matrix3d& F) {
  constexpr double kScoreScale = 1.5;  // thresholds
  hypotheses_.push_back({F, ScoreSampson(pair_.points, F, kScoreScale * pair_.max_error_px)});
}

Eigen::Matrix3d FundamentalResampling::Refine(const Eigen::Matrix3d& start,
                                              const FundamentalRefinementOptions& options,
                                              int max_num_points) {
  constexpr double kReach = 10.0;  // thresholds: matches farther away have no weight
  errors_.resize(pair_.points.num_blocks() * PointPairs::kBlock);
  SampsonErrors(pair_.points, start, errors_.data());
  near_indices_.clear();
  for (int i = 0; i < pair_.size(); ++i) {
    if (errors_[i] < kReach * pair_.max_error_px) near_indices_.push_back(i);
  }
  const size_t step = 1 + near_indices_.size() / (max_num_points + 1);
  for (size_t k = 0; k * step < near_indices_.size(); ++k)
    near_indices_[k] = near_indices_[k * step];
  near_indices_.resize((near_indices_.size() + step - 1) / step);
  near_.SetSubset(pair_.points, near_indices_.data(), static_cast<int>(near_indices_.size()));
  return RefineFundamentalMatrix(near_, start, options).F;
}

}  // namespace cairn::internal
