#include "two_view/search/pose_search.h"

#include <algorithm>
#include <cmath>

#include "cairn/geometry/epipolar.h"
#include "cairn/robust/sampson_kernels.h"
#include "cairn/solvers/essential.h"
#include "cairn/solvers/five_point.h"
#include "two_view/decide/evidence.h"
#include "two_view/search/cheirality.h"

namespace cairn::internal {
namespace {

// Hypotheses are ranked and roughly refined on so many matches.
constexpr int kSubsetSize = 192;
// The scale between the rough one and the threshold itself, in thresholds.
constexpr double kMiddleScale = 3.0;
// Hypotheses are refined in groups: a few steps tell which of a group is worth more.
constexpr int kGroupSize = 3, kNumFirstSteps = 2;
// A refined hypothesis goes on while its support is at least this share of the best so far.
constexpr double kPromising = 0.7;
// Matches that a model near the best one might explain are nearer than so many thresholds.
constexpr double kReach = 16.0;
// Refined models agree when their support does, and their matrices (|E|^2 = 2; 0.05 is about 2
// degrees).
constexpr double kEqualSupport = 0.9, kEqualMatrix = 0.05;

double Distance(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return std::min((a - b).norm(), (a + b).norm());
}

PoseRefinementOptions Refinement(double scale_px, int max_iterations) {
  PoseRefinementOptions options;
  options.loss = RobustLoss::kGemanMcClure;
  options.min_relative_gain = 1e-3;
  options.scale_px = scale_px;
  options.max_iterations = max_iterations;
  return options;
}

template <class T>
bool BySupport(const T& a, const T& b) {
  return a.support > b.support;
}

}  // namespace

void PoseSearch::Reset(const PreparedPair& pair) {
  pair_ = &pair;
  subset_.SetPrefix(pair.points, std::min(pair.size(), kSubsetSize));
  hypotheses_.clear();
  num_hypotheses_ = 0;
  best_score_ = best_subset_score_ = 0.0;
  num_agreeing_ = 0;
  has_converged_ = has_evidence_ = false;
}

void PoseSearch::Add(const Eigen::Matrix3d& E) {
  ++num_hypotheses_;
  hypotheses_.push_back(
      {E, SoftScoreSampson(subset_, E, options_.rough_error_ratio * pair_->max_error_px)});
}

void PoseSearch::RefineBest(int max_num_refined) {
  const int count = MoveBestToFront(max_num_refined);
  for (int first = 0; first < count && !has_converged_; first += kGroupSize) {
    started_.clear();
    for (int k = first; k < std::min(first + kGroupSize, count); ++k) Start(hypotheses_[k].E);
    Finish(std::min_element(started_.begin(), started_.end(), BySupport<Started>)->pose);
  }
  hypotheses_.clear();
}

int PoseSearch::MoveBestToFront(int max_count) {
  const auto count = std::min<ptrdiff_t>(max_count, std::ssize(hypotheses_));
  std::partial_sort(hypotheses_.begin(), hypotheses_.begin() + count, hypotheses_.end(),
                    BySupport<Hypothesis>);
  return static_cast<int>(count);
}

void PoseSearch::Resample(const ResampleOptions& options, Rng* rng) {
  constexpr double kGain = 1.005;  // of the support: less is no progress
  int num_stale_rounds = 0;
  for (int round = 0; round < options.max_num_rounds && HasModel(); ++round) {
    if (num_stale_rounds >= options.patience) break;
    FindReach();
    // Models near each other differ in how closely they fit, which only the noise's own scale
    // tells.
    guided_.Learn(*pair_, errors_, kReach * pair_->max_error_px);
    const double support_before = guided_.Score(best_E_);
    double best_support = support_before;
    SampleExplained(options.num_samples, rng);
    const int num_refined = MoveBestToFront(options.num_refined);
    for (int k = 0; k < num_refined; ++k) {
      const EssentialDecomposition parts = DecomposeEssential(hypotheses_[k].E);
      const Rigid3d pose =
          RefinePose(reach_, Rigid3d(parts.R1, parts.t), Refinement(pair_->max_error_px, 10))
              .cam2_from_cam1;
      const Eigen::Matrix3d E = EssentialFromPose(pose);
      double support = guided_.Score(E);
      if (!(support > best_support)) continue;
      support *= WeightInFront(pose);
      if (!(support > best_support)) continue;
      const double score = ScoreSampson(pair_->points, E, pair_->max_error_px);
      if (score < kEqualSupport * best_score_) continue;
      best_score_ = std::max(best_score_, score);
      best_support = support;
      best_pose_ = pose;
      best_E_ = E;
    }
    hypotheses_.clear();
    num_stale_rounds = best_support < kGain * support_before ? num_stale_rounds + 1 : 0;
  }
  if (HasModel()) best_score_ = ScoreSampson(pair_->points, best_E_, pair_->max_error_px);
}

void PoseSearch::FindReach() {
  constexpr double kExplained = 2.0;  // thresholds
  errors_.resize(pair_->points.num_blocks() * PointPairs::kBlock);
  SampsonErrors(pair_->points, best_E_, errors_.data());
  explained_.clear();
  reach_indices_.clear();
  for (int i = 0; i < pair_->size(); ++i) {
    if (errors_[i] < kReach * pair_->max_error_px) reach_indices_.push_back(i);
    if (errors_[i] < kExplained * pair_->max_error_px) explained_.push_back(i);
  }
  reach_.SetSubset(pair_->points, reach_indices_.data(), static_cast<int>(reach_indices_.size()));
}

void PoseSearch::SampleExplained(int num_samples, Rng* rng) {
  constexpr int kSampleSize = FivePoint::kSampleSize;
  constexpr double kScoreScale = 1.5;  // thresholds
  const auto n = static_cast<uint32_t>(explained_.size());
  if (n < kSampleSize) return;
  Eigen::Matrix3d models[FivePoint::kMaxSolutions];
  double best_sample_score = 0.0;
  for (int k = 0; k < num_samples; ++k) {
    uint32_t sample[kSampleSize];
    rng->Sample(n, kSampleSize, sample);
    PointCorrespondence points[kSampleSize];
    for (int m = 0; m < kSampleSize; ++m) {
      const int i = explained_[sample[m]];
      points[m] = {pair_->points.Point1(i), pair_->points.Point2(i)};
    }
    const int count = FivePoint::Solve(points, models);
    num_hypotheses_ += count;
    // Models of right matches far apart are good: all matches that matter, at nearly the final
    // threshold, tell them apart.
    for (int m = 0; m < count; ++m) {
      const double score = ScoreSampson(reach_, models[m], kScoreScale * pair_->max_error_px,
                                        kPromising * best_sample_score);
      if (score < 0.0) continue;
      best_sample_score = std::max(best_sample_score, score);
      hypotheses_.push_back({models[m], score});
    }
  }
}

void PoseSearch::Start(const Eigen::Matrix3d& E) {
  const EssentialDecomposition parts = DecomposeEssential(E);
  const Rigid3d pose =
      RefineOnSubset(Rigid3d(parts.R1, parts.t), options_.rough_error_ratio, kNumFirstSteps);
  started_.push_back({pose, SoftScoreSampson(subset_, EssentialFromPose(pose),
                                             MiddleScale() * pair_->max_error_px)});
}

void PoseSearch::Finish(const Rigid3d& started) {
  Rigid3d pose = RefineOnSubset(started, options_.rough_error_ratio, 8 - kNumFirstSteps);
  pose = RefineOnSubset(pose, MiddleScale(), 6);
  const double score = ScoreSampson(subset_, EssentialFromPose(pose), 2.0 * pair_->max_error_px);
  if (score < kPromising * best_subset_score_) return;
  best_subset_score_ = std::max(best_subset_score_, score);
  pose = RefineOnSubset(pose, 1.0, 8);
  if (pair_->size() > subset_.size()) pose = RefineOnAll(pose, 4);
  AddRefined(pose);
}

double PoseSearch::WeightInFront(const Rigid3d& pose) {
  errors_.resize(pair_->points.num_blocks() * PointPairs::kBlock);
  SampsonErrors(pair_->points, EssentialFromPose(pose), errors_.data());
  explained_.clear();
  for (int i = 0; i < pair_->size(); ++i) {
    if (errors_[i] < pair_->max_error_px) explained_.push_back(i);
  }
  // Wrong matches may be behind right poses; few of them are no reason to choose between these.
  constexpr double kMostInFront = 0.75;
  const double share = Cheirality(*pair_).Choose(pose, explained_).share;
  return share < kMostInFront ? share : 1.0;
}

double PoseSearch::MiddleScale() const {
  return std::min(kMiddleScale, options_.rough_error_ratio);
}

Rigid3d PoseSearch::RefineOnSubset(const Rigid3d& start, double scale, int max_iterations) const {
  return RefinePose(subset_, start, Refinement(scale * pair_->max_error_px, max_iterations))
      .cam2_from_cam1;
}

Rigid3d PoseSearch::RefineOnAll(const Rigid3d& start, int max_iterations) const {
  return RefinePose(pair_->points, start, Refinement(pair_->max_error_px, max_iterations))
      .cam2_from_cam1;
}

void PoseSearch::AddRefined(const Rigid3d& pose) {
  const Eigen::Matrix3d E = EssentialFromPose(pose);
  double score = ScoreSampson(pair_->points, E, pair_->max_error_px);
  if (score < kEqualSupport * best_score_) return;
  score *= WeightInFront(pose);
  if (score < kEqualSupport * best_score_) return;
  const bool agrees = num_agreeing_ > 0 && Distance(E, best_E_) < kEqualMatrix;
  if (agrees) {
    ++num_agreeing_;
  } else if (score > best_score_) {
    num_agreeing_ = 1;
  }
  if (score > best_score_) {
    best_score_ = score;
    best_pose_ = pose;
    best_E_ = E;
  }
  // Support is about two thirds of the number of inliers; to be convinced takes more than to
  // accept.
  const int num_inliers = static_cast<int>(best_score_);
  const double chance = 0.5 * pair_->chance_per_px * pair_->max_error_px;
  has_evidence_ = num_inliers >= 8 && Log10NumFalseAlarms(pair_->size(), num_inliers, 5, 10,
                                                          chance) < -options_.min_log10_evidence;
  has_converged_ = has_evidence_ && (num_agreeing_ >= 2 || best_score_ > 0.5 * pair_->size());
}

}  // namespace cairn::internal
