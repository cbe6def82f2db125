#include "two_view/search/fundamental_resampling.h"

#include <algorithm>
#include <optional>

#include "cairn/math/so3.h"
#include "cairn/solvers/seven_point.h"
#include "robust/fundamental_refinement.h"
#include "robust/match_errors.h"
#include "two_view/decide/focal_plausibility.h"
#include "two_view/search/guided_support.h"
#include "two_view/search/plane_search.h"

namespace cairn::internal {
namespace {

constexpr int kNumSamples = 20;       // of each kind, a round
constexpr double kImplausible = 0.5;  // what support without plausible focal lengths is worth

// Fundamental matrices near the best one.
class FundamentalNeighborhood {
 public:
  FundamentalNeighborhood(const PreparedPair& pair, const Eigen::Matrix3d& start)
      : pair_(pair), best_(start) {
    supported_.SetPrefix(pair.points, pair.IsSupported() ? pair.NumSupported() : 0);
  }

  double Begin() {
    const MatchErrors errors(pair_.points, best_);
    explained_ = errors.Below(pair_.max_error_px);
    sigma_px_ = NoiseScalePx(pair_, errors.values(), kSigmaOfMedian);
    return SupportOf(best_);
  }

  // Moves the most supported hypotheses to the front, plausible ones before others.
  int Sample(int num_samples, int max_count, Rng* rng) {
    hypotheses_.clear();
    SampleModels<SevenPoint>(pair_, explained_, num_samples, rng,
                             [this](const Eigen::Matrix3d& F) { Add(F); });
    SamplePlaneAndParallax(rng);
    const int num_tried = MoveBestToFront(kNumSamples, &hypotheses_);
    std::stable_partition(hypotheses_.begin(), hypotheses_.begin() + num_tried,
                          [this](const Hypothesis& h) { return IsPlausible(h.F); });
    return std::min(max_count, num_tried);
  }

  double Try(int k, double best_support) {
    const Eigen::Matrix3d F =
        Refine(hypotheses_[k].F,
               {.scale_px = pair_.max_error_px, .max_iterations = 10, .min_relative_gain = 1e-3},
               kEnoughMatches);
    const double support = SupportOf(F);
    if (!(support > best_support)) return best_support;
    best_ = F;
    return support;
  }

  Eigen::Matrix3d BestAtNoise() const {
    const MatchErrors errors(pair_.points, best_);
    return Refine(best_,
                  {.scale_px = NoiseScalePx(pair_, errors.values(), kLossSigmas * kSigmaOfMedian)},
                  pair_.size());
  }

 private:
  struct Hypothesis {
    Eigen::Matrix3d F;
    double support;
  };

  bool IsPlausible(const Eigen::Matrix3d& F) const {
    return HasPlausibleFocals(F, *pair_.input.camera1, *pair_.input.camera2);
  }

  double SupportOf(const Eigen::Matrix3d& F) const {
    const double support =
        SoftScoreSampson(pair_.points, F, sigma_px_) + SoftScoreSampson(supported_, F, sigma_px_);
    return IsPlausible(F) ? support : kImplausible * support;
  }

  void Add(const Eigen::Matrix3d& F) {
    hypotheses_.push_back({F, ScoreSampson(pair_.points, F, pair_.max_error_px)});
  }

  void SamplePlaneAndParallax(Rng* rng) {
    constexpr int kNumPairs = 5 * kNumSamples;
    const double max_error_px = pair_.max_error_px;
    const std::optional<Eigen::Matrix3d> H = FindPlane(pair_, explained_, max_error_px, rng);
    if (!H) return;
    // Of all matches: what F does not explain may be right.
    MatchErrors errors;
    errors.SetHomography(pair_.points, *H);
    std::vector<int32_t> off_plane;
    const int num_candidates = supported_.size() > 0 ? supported_.size() : pair_.size();
    for (int i = 0; i < num_candidates; ++i) {
      if (errors[i] > kOutside * pair_.max_error_px) off_plane.push_back(i);
    }
    const auto n = static_cast<uint32_t>(off_plane.size());
    if (n < 2) return;
    for (int k = 0; k < kNumPairs; ++k) {
      uint32_t sample[2];
      rng->Sample(n, 2, sample);
      Eigen::Vector3d lines[2];
      for (int m = 0; m < 2; ++m) {
        const int i = off_plane[sample[m]];
        lines[m] = pair_.points.Point2(i).homogeneous().cross(
            Eigen::Vector3d(*H * pair_.points.Point1(i).homogeneous()));
      }
      const Eigen::Vector3d epipole = lines[0].cross(lines[1]);
      if (epipole.norm() > 0.0) Add(CrossMatrix(epipole.normalized()) * *H);
    }
  }

  // On so many points near `start`, spread over all that are. From farther away than this, wrong
  // matches take more of their places than right ones.
  Eigen::Matrix3d Refine(const Eigen::Matrix3d& start, const FundamentalRefinementOptions& options,
                         int max_num_points) const {
    constexpr double kMostThresholds = 10.0;
    std::vector<int32_t> near =
        MatchErrors(pair_.points, start).Below(kMostThresholds * pair_.max_error_px);
    const size_t step = 1 + near.size() / (max_num_points + 1);
    for (size_t k = 0; k * step < near.size(); ++k) near[k] = near[k * step];
    near.resize((near.size() + step - 1) / step);
    PointPairs points;
    points.SetSubset(pair_.points, near.data(), static_cast<int>(near.size()));
    return RefineFundamentalMatrix(points, start, options).F();
  }

  const PreparedPair& pair_;
  Eigen::Matrix3d best_;
  double sigma_px_ = 0.0;
  PointPairs supported_;
  std::vector<int32_t> explained_;
  std::vector<Hypothesis> hypotheses_;
};

}  // namespace

Eigen::Matrix3d ResampleFundamental(const PreparedPair& pair, const Eigen::Matrix3d& start) {
  FundamentalNeighborhood neighborhood(pair, start);
  Rng rng(pair.input.seed, "improve_fundamental", pair.input.pair_id);
  Resample({.num_samples = kNumSamples, .effort = 4}, &rng, &neighborhood);
  return neighborhood.BestAtNoise();
}

}  // namespace cairn::internal
