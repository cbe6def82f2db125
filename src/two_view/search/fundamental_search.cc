#include "two_view/search/fundamental_search.h"

#include <algorithm>

#include "cairn/solvers/eight_point.h"
#include "cairn/solvers/seven_point.h"
#include "robust/match_errors.h"
#include "two_view/decide/evidence.h"
#include "two_view/search/fundamental_resampling.h"

namespace cairn::internal {
namespace {

// Fits F to what it explains, with a shrinking threshold, while that gains support.
double Improve(const PreparedPair& pair, Eigen::Matrix3d* F) {
  double best = ScoreSampson(pair.points, *F, pair.max_error_px);
  MatchErrors errors;
  std::vector<PointCorrespondence> points;
  Eigen::Matrix3d current = *F;
  for (const double scale : {4.0, 2.0, 1.5, 1.0, 1.0}) {
    errors.SetSampson(pair.points, current);
    points.clear();
    for (const int32_t i : errors.Below(scale * pair.max_error_px)) {
      points.push_back(pair.Points(i));
    }
    if (points.size() < 8 || !FundamentalFromEightPoints(points, &current)) break;
    const double score = ScoreSampson(pair.points, current, pair.max_error_px);
    if (score > best) {
      best = score;
      *F = current;
    }
  }
  return best;
}

class SevenPointEstimator {
 public:
  static constexpr int kSampleSize = SevenPoint::kSampleSize;
  static constexpr int kMaxSolutions = SevenPoint::kMaxSolutions;
  using Model = Eigen::Matrix3d;

  // Samples are drawn from the first `num_data`.
  SevenPointEstimator(const PreparedPair& pair, int num_data) : pair_(pair) {
    sampled_.SetPrefix(pair.points, num_data);
  }
  int NumData() const { return sampled_.size(); }
  int Solve(const uint32_t* sample, Model* models) const {
    PointCorrespondence points[kSampleSize];
    for (int i = 0; i < kSampleSize; ++i) points[i] = pair_.Points(static_cast<int>(sample[i]));
    return SevenPoint::Solve(points, models);
  }
  double Score(const Model& F, double bound) const {
    return ScoreSampson(pair_.points, F, pair_.max_error_px, bound);
  }
  double Optimize(Model& F, int* num_inliers) const {
    const double score = Improve(pair_, &F);
    // Of those that samples are drawn from; uniform errors have a mean support of 2/3.
    *num_inliers = static_cast<int>(1.5 * ScoreSampson(sampled_, F, pair_.max_error_px));
    return score;
  }

 private:
  const PreparedPair& pair_;
  PointPairs sampled_;
};

std::optional<FundamentalModel> Measure(const PreparedPair& pair, const Eigen::Matrix3d& F) {
  FundamentalModel model;
  model.F = F;
  model.inliers = MatchErrors(pair.points, F).Below(pair.max_error_px);
  if (static_cast<int>(model.inliers.size()) <= SevenPoint::kSampleSize) return std::nullopt;
  model.log10_nfa = Log10NumFalseAlarms(pair, F, model.inliers, kFundamental);
  return model;
}

}  // namespace

std::optional<FundamentalModel> RefineFundamental(const PreparedPair& pair,
                                                  const Eigen::Matrix3d& start) {
  Eigen::Matrix3d F = start;
  Improve(pair, &F);
  return Measure(pair, F);
}

std::optional<FundamentalModel> FindFundamental(const PreparedPair& pair,
                                                const RansacOptions& options) {
  const int num_data =
      pair.IsSupported() ? std::max(pair.NumSupported(), 2 * SevenPoint::kSampleSize) : pair.size();
  SevenPointEstimator estimator(pair, std::min(num_data, pair.size()));
  Rng rng(pair.input.seed, "seven_point", pair.input.pair_id);
  const auto report = Ransac(estimator, options, rng);
  if (!report.model) return std::nullopt;
  return Measure(pair, *report.model);
}

std::optional<FundamentalModel> ImproveFundamental(const PreparedPair& pair,
                                                   const Eigen::Matrix3d& start) {
  return Measure(pair, ResampleFundamental(pair, start));
}

}  // namespace cairn::internal
