#include "two_view/search/fundamental_search.h"

#include <algorithm>

#include "cairn/robust/ransac.h"
#include "cairn/robust/sampson_kernels.h"
#include "cairn/solvers/eight_point.h"
#include "cairn/solvers/seven_point.h"
#include "two_view/decide/evidence.h"
#include "two_view/search/fundamental_resampling.h"

namespace cairn::internal {
namespace {

void FindInliers(const PreparedPair& pair, const Eigen::Matrix3d& F, double max_error_px,
                 std::vector<float>* errors, std::vector<int32_t>* inliers) {
  errors->resize(pair.points.num_blocks() * PointPairs::kBlock);
  SampsonErrors(pair.points, F, errors->data());
  inliers->clear();
  for (int i = 0; i < pair.size(); ++i) {
    if ((*errors)[i] < max_error_px) inliers->push_back(i);
  }
}

// Fits F to what it explains, with a shrinking threshold, while that gains support.
double Improve(const PreparedPair& pair, Eigen::Matrix3d* F) {
  double best = ScoreSampson(pair.points, *F, pair.max_error_px);
  std::vector<float> errors;
  std::vector<int32_t> inliers;
  std::vector<PointCorrespondence> points;
  Eigen::Matrix3d current = *F;
  for (const double scale : {4.0, 2.0, 1.5, 1.0, 1.0}) {
    FindInliers(pair, current, scale * pair.max_error_px, &errors, &inliers);
    points.clear();
    for (const int32_t i : inliers)
      points.push_back({pair.points.Point1(i), pair.points.Point2(i)});
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

  SevenPointEstimator(const PreparedPair& pair, int num_data) : pair_(pair), num_data_(num_data) {}
  int NumData() const { return num_data_; }
  int Solve(const uint32_t* sample, Model* models) const {
    PointCorrespondence points[kSampleSize];
    for (int i = 0; i < kSampleSize; ++i) {
      points[i] = {pair_.points.Point1(sample[i]), pair_.points.Point2(sample[i])};
    }
    return SevenPoint::Solve(points, models);
  }
  double Score(const Model& F, double bound) const {
    return ScoreSampson(pair_.points, F, pair_.max_error_px, bound);
  }
  double Optimize(Model& F, int* num_inliers) const {
    const double score = Improve(pair_, &F);
    *num_inliers = static_cast<int>(1.5 * score);  // uniform errors have a mean support of 2/3
    return score;
  }

 private:
  const PreparedPair& pair_;
  int num_data_;
};

std::optional<FundamentalModel> Measure(const PreparedPair& pair, const Eigen::Matrix3d& F) {
  FundamentalModel model;
  model.F = F;
  std::vector<float> errors;
  FindInliers(pair, F, pair.max_error_px, &errors, &model.inliers);
  if (static_cast<int>(model.inliers.size()) <= SevenPoint::kSampleSize) return std::nullopt;
  PointPairs shifted;
  std::vector<uint64_t> cells;
  const double chance = ChanceOfInlier(pair, F, pair.max_error_px, &shifted);
  const int num_inliers = static_cast<int>(model.inliers.size());
  const int num_distinct = EstimateNumDistinct(pair, model.inliers, &cells);
  model.log10_nfa = Log10NumFalseAlarms(pair.size() - num_inliers + num_distinct, num_distinct,
                                        SevenPoint::kSampleSize, SevenPoint::kMaxSolutions, chance);
  return model;
}

}  // namespace

std::optional<FundamentalModel> RefineFundamental(const PreparedPair& pair,
                                                  const Eigen::Matrix3d& start) {
  Eigen::Matrix3d F = start;
  Improve(pair, &F);
  return Measure(pair, F);
}

std::optional<FundamentalModel> FindFundamental(const PairInput& input, const PreparedPair& pair,
                                                const TwoViewOptions& options) {
  const bool is_supported = pair.IsSupported();
  const int num_data =
      is_supported ? std::max(pair.NumSupported(), 2 * SevenPoint::kSampleSize) : pair.size();
  SevenPointEstimator estimator(pair, std::min(num_data, pair.size()));
  RansacOptions ransac;
  ransac.confidence = options.confidence;
  ransac.min_iterations = std::min(options.min_iterations, options.max_fallback_samples);
  ransac.max_iterations = static_cast<int64_t>(options.max_fallback_samples *
                                               (is_supported ? 1.0 : options.unsupported_budget));
  if (ransac.max_iterations < 1) return std::nullopt;
  Rng rng(input.seed, "seven_point", input.pair_id);
  const auto report = Ransac(estimator, ransac, rng);
  if (report.status != RansacStatus::kConfident && report.status != RansacStatus::kExhausted) {
    return std::nullopt;
  }
  return Measure(pair, report.model);
}

std::optional<FundamentalModel> ImproveFundamental(const PairInput& input, const PreparedPair& pair,
                                                   const Eigen::Matrix3d& start) {
  Rng rng(input.seed, "improve_fundamental", input.pair_id);
  return Measure(pair, FundamentalResampling(input, pair).Run(start, &rng));
}

}  // namespace cairn::internal
