#include "two_view/decide/evidence.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "math/log_binomial.h"
#include "robust/sampson_kernels.h"

namespace cairn::internal {
namespace {

double Log10Binomial(int n, int k) { return LogBinomial(n, k) / std::log(10.0); }

}  // namespace

double Log10NumFalseAlarms(int num_matches, int num_inliers, const ModelKind& kind, double chance) {
  const auto [sample_size, num_models, passes] = kind;
  if (num_inliers <= sample_size) return std::log10(static_cast<double>(num_models));
  return std::log10(static_cast<double>(num_models)) +
         std::log10(static_cast<double>(num_matches - sample_size)) +
         Log10Binomial(num_matches, num_inliers) + Log10Binomial(num_inliers, sample_size) +
         (num_inliers - sample_size) * std::log10(std::clamp(chance, 1e-12, 1.0));
}

double Log10NumFalseAlarms(const PreparedPair& pair, const Eigen::Matrix3d& E,
                           std::span<const int32_t> inliers, const ModelKind& kind) {
  const double chance = kind.chance * ChanceOfInlier(pair, E, pair.max_error_px);
  const int num_distinct = EstimateNumDistinct(pair, inliers);
  const int num_repeated = static_cast<int>(inliers.size()) - num_distinct;
  return Log10NumFalseAlarms(pair.size() - num_repeated, num_distinct, kind, chance);
}

double ChanceOfInlier(const PreparedPair& pair, const Eigen::Matrix3d& E, double max_error_px) {
  const int n = pair.size();
  const double prior = std::min(1.0, pair.chance_per_px * max_error_px);
  // Cyclic shifts pair every point with points of other matches.
  constexpr int kNumShifts = 8;
  PointPairs shifted;
  double num_close = 0.0, num_tried = 0.0;
  for (int k = 1; k <= kNumShifts; ++k) {
    const int shift = static_cast<int>((static_cast<int64_t>(k) * n) / (kNumShifts + 1));
    if (shift == 0) continue;
    shifted.SetShifted(pair.points, shift);
    // MSAC support of errors uniform within the band is 2/3 an inlier.
    num_close += 1.5 * std::max(0.0, ScoreSampson(shifted, E, max_error_px));
    num_tried += n;
  }
  return (num_close + kEnoughMatches * prior) / (num_tried + kEnoughMatches);
}

bool HasParallax(const PreparedPair& pair, const Eigen::Matrix3d& H,
                 std::span<const int32_t> inliers, double noise_px, double min_log10_evidence) {
  constexpr ModelKind kEpipole = {2, 1};
  MatchErrors errors;
  errors.SetHomography(pair.points, H);
  const auto is_off = [&](float error) { return error > 2.0 * kOutside * noise_px; };
  const auto num_off = std::ranges::count_if(errors.values(), is_off);
  const auto num_explained =
      std::ranges::count_if(inliers, [&](int32_t i) { return is_off(errors[i]); });
  const double chance = pair.chance_per_px * pair.max_error_px;
  return Log10NumFalseAlarms(static_cast<int>(num_off), static_cast<int>(num_explained), kEpipole,
                             chance) < -min_log10_evidence;
}

int EstimateNumDistinct(const PreparedPair& pair, std::span<const int32_t> matches) {
  const double scale1 = pair.points.focal1_px() / (kOutside * pair.max_error_px);
  const double scale2 = pair.points.focal2_px() / (kOutside * pair.max_error_px);
  // 16 bits a coordinate: cells far outside the image may coincide, which does no harm.
  auto cell = [](double scaled) {
    constexpr double kFar = 1e15;  // an integer holds it; NaN is far, too
    const double bounded = std::fmax(std::fmin(std::floor(scaled), kFar), -kFar);
    return static_cast<uint64_t>(static_cast<int64_t>(bounded) & 0xffff);
  };
  if (matches.empty()) return 0;
  std::vector<uint64_t> cells;
  const size_t step = 1 + (matches.size() - 1) / kEnoughMatches;
  for (size_t k = 0; k < matches.size(); k += step) {
    const int32_t i = matches[k];
    Eigen::Vector2d x1 = scale1 * pair.points.Point1(i);
    Eigen::Vector2d x2 = scale2 * pair.points.Point2(i);
    if (pair.points.is_wide()) {  // far off axis, a spot of the image is a large one of the plane
      x1 /= pair.points.Point1(i).homogeneous().norm();
      x2 /= pair.points.Point2(i).homogeneous().norm();
    }
    cells.push_back(cell(x1.x()) << 48 | cell(x1.y()) << 32 | cell(x2.x()) << 16 | cell(x2.y()));
  }
  std::sort(cells.begin(), cells.end());
  const auto num_distinct = std::unique(cells.begin(), cells.end()) - cells.begin();
  return static_cast<int>(static_cast<size_t>(num_distinct) * matches.size() / cells.size());
}

}  // namespace cairn::internal
