#include "two_view/search/pose_search.h"

#include <algorithm>
#include <cmath>

#include "cairn/geometry/epipolar.h"
#include "robust/pose_refinement.h"
#include "two_view/decide/evidence.h"

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

template <class T>
bool BySupport(const T& a, const T& b) {
  return a.support > b.support;
}

}  // namespace

PoseSearch::PoseSearch(const PreparedPair& pair, const TwoViewOptions& options)
    : pair_(pair), options_(options), cheirality_(pair) {
  subset_.SetPrefix(pair.points, std::min(pair.size(), kSubsetSize));
}

void PoseSearch::Add(const Eigen::Matrix3d& E) {
  ++num_hypotheses_;
  hypotheses_.push_back(
      {E, SoftScoreSampson(subset_, E, options_.rough_error_ratio * pair_.max_error_px)});
}

void PoseSearch::RefineBest(int max_num_refined) {
  const int count = MoveBestToFront(max_num_refined);
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

int PoseSearch::MoveBestToFront(int max_count) {
  const auto count = std::min<ptrdiff_t>(max_count, std::ssize(hypotheses_));
  std::partial_sort(hypotheses_.begin(), hypotheses_.begin() + count, hypotheses_.end(),
                    BySupport<Hypothesis>);
  return static_cast<int>(count);
}

PoseSearch::Started PoseSearch::Start(const Eigen::Matrix3d& E) const {
  const Rigid3d pose =
      Refine(subset_, PosesFromEssential(E)[0], options_.rough_error_ratio, kNumFirstSteps);
  return {pose,
          SoftScoreSampson(subset_, EssentialFromPose(pose), MiddleScale() * pair_.max_error_px)};
}

void PoseSearch::Finish(const Rigid3d& started) {
  Rigid3d pose = Refine(subset_, started, options_.rough_error_ratio, kNumSteps - kNumFirstSteps);
  pose = Refine(subset_, pose, MiddleScale(), kNumSteps);
  const double score = ScoreSampson(subset_, EssentialFromPose(pose), pair_.max_error_px);
  if (score < kEqualSupport * best_subset_score_) return;
  best_subset_score_ = std::max(best_subset_score_, score);
  pose = Refine(subset_, pose, 1.0, kNumSteps);
  if (pair_.size() > subset_.size()) pose = Refine(pair_.points, pose, 1.0, kNumSteps);
  AddRefined(pose);
}

double PoseSearch::MiddleScale() const { return std::sqrt(options_.rough_error_ratio); }

Rigid3d PoseSearch::Refine(const PointPairs& points, const Rigid3d& start, double scale,
                           int max_iterations) const {
  PoseRefinementOptions options;
  options.loss = RobustLoss::kGemanMcClure;
  options.min_relative_gain = 1e-3;
  options.scale_px = scale * pair_.max_error_px;
  options.max_iterations = max_iterations;
  return RefinePose(points, start, options).cam2_from_cam1;
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
