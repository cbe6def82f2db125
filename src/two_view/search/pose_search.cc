#include "two_view/search/pose_search.h"

#include <algorithm>
#include <cmath>

#include "cairn/geometry/epipolar.h"
#include "robust/pose_refinement.h"
#include "two_view/decide/evidence.h"
#include "two_view/search/resampling.h"

namespace cairn::internal {
namespace {

// Hypotheses are ranked and roughly refined on so many matches.
constexpr int kSubsetSize = 192;
// Hypotheses are refined in groups: a few steps tell which of a group is worth more.
constexpr int kGroupSize = 3, kNumFirstSteps = 2;
// Refined models agree when their matrices do (|E|^2 = 2; 0.05 is about 2 degrees).
constexpr double kEqualMatrix = 0.05;

double Distance(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return std::min((a - b).norm(), (a + b).norm());
}

}  // namespace

Rigid3d RefineSmoothly(const PointPairs& points, const Rigid3d& start, double scale_px,
                       int max_iterations) {
  return RefinePose(points, start,
                    {.loss = RobustLoss::kGemanMcClure,
                     .scale_px = scale_px,
                     .max_iterations = max_iterations,
                     .min_relative_gain = 1e-3});
}

PoseSearch::PoseSearch(const PreparedPair& pair, const TwoViewOptions& options)
    : pair_(pair), options_(options), cheirality_(pair) {
  subset_.SetPrefix(pair.points, std::min(pair.size(), kSubsetSize));
}

void PoseSearch::Add(const Eigen::Matrix3d& E) {
  ++num_hypotheses_;
  hypotheses_.push_back({E, SoftScoreSampson(subset_, E, RoughPx())});
}

void PoseSearch::RefineBest(int max_num_refined) {
  const int count = MoveBestToFront(max_num_refined, &hypotheses_);
  for (int first = 0; first < count && !has_converged_; first += kGroupSize) {
    Started best = Start(hypotheses_[first].E);
    for (int k = first + 1; k < std::min(first + kGroupSize, count); ++k) {
      const Started started = Start(hypotheses_[k].E);
      if (started.support > best.support) best = started;
    }
    Finish(best.pose);
  }
  hypotheses_.clear();
}

PoseSearch::Started PoseSearch::Start(const Eigen::Matrix3d& E) const {
  const Rigid3d pose = RefineSmoothly(subset_, PosesFromEssential(E)[0], RoughPx(), kNumFirstSteps);
  return {pose, SoftScoreSampson(subset_, EssentialFromPose(pose), MiddlePx())};
}

void PoseSearch::Finish(const Rigid3d& started) {
  const double max_error_px = pair_.max_error_px;
  Rigid3d pose = RefineSmoothly(subset_, started, RoughPx(), kNumSteps - kNumFirstSteps);
  pose = RefineSmoothly(subset_, pose, MiddlePx(), kNumSteps);
  const double score = ScoreSampson(subset_, EssentialFromPose(pose), max_error_px);
  if (score < kEqualSupport * best_subset_score_) return;
  best_subset_score_ = std::max(best_subset_score_, score);
  pose = RefineSmoothly(subset_, pose, max_error_px, kNumSteps);
  if (pair_.size() > subset_.size()) {
    pose = RefineSmoothly(pair_.points, pose, max_error_px, kNumSteps);
  }
  AddRefined(pose);
}

double PoseSearch::RoughPx() const { return options_.rough_error_factor * pair_.max_error_px; }

double PoseSearch::MiddlePx() const {
  return std::sqrt(options_.rough_error_factor) * pair_.max_error_px;
}

void PoseSearch::AddRefined(const Rigid3d& pose) {
  const Eigen::Matrix3d E = EssentialFromPose(pose);
  double score = ScoreSampson(pair_.points, E, pair_.max_error_px);
  if (score < kEqualSupport * best_.score) return;
  score *= cheirality_.WeightOf(pose);
  if (score < kEqualSupport * best_.score) return;
  const bool agrees = num_agreeing_ > 0 && Distance(E, best_.E) < kEqualMatrix;
  if (agrees) {
    ++num_agreeing_;
  } else if (score > best_.score) {
    num_agreeing_ = 1;
  }
  if (score > best_.score) best_ = {pose, E, score};
  // Support is about two thirds of the number of inliers; to be convinced takes more than to
  // accept.
  const int num_inliers = static_cast<int>(best_.score);
  const double chance = 0.5 * pair_.chance_per_px * pair_.max_error_px;
  has_evidence_ = num_inliers >= 8 && Log10NumFalseAlarms(pair_.size(), num_inliers, kEssential,
                                                          chance) < -options_.min_log10_evidence;
  has_converged_ = has_evidence_ && (num_agreeing_ >= 2 || best_.score > 0.5 * pair_.size());
}

}  // namespace cairn::internal
