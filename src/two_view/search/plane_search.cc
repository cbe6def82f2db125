#include "two_view/search/plane_search.h"

#include <vector>

#include "cairn/solvers/homography.h"
#include "robust/match_errors.h"

namespace cairn::internal {

std::optional<Eigen::Matrix3d> FindPlane(const PreparedPair& pair, std::span<const int32_t> matches,
                                         double max_error_px, Rng* rng) {
  // More than find a plane of 80 % of the matches with 99.9 % (13); and of half with 72 %.
  constexpr int kNumSamples = 20;
  PointPairs points;
  points.SetSubset(pair.points, matches.data(), static_cast<int>(matches.size()));
  double best_score = 0.0;
  Eigen::Matrix3d best;
  SampleModels<HomographyFourPoint>(pair, matches, kNumSamples, rng, [&](const Eigen::Matrix3d& H) {
    const double score = ScoreHomography(points, H, max_error_px);
    if (!(score > best_score)) return;
    best_score = score;
    best = H;
  });
  if (best_score == 0.0) return std::nullopt;
  MatchErrors errors;
  for (int round = 0; round < 2; ++round) {
    errors.SetHomography(points, best);
    std::vector<PointCorrespondence> on_plane;
    for (const int32_t i : errors.Below(max_error_px)) on_plane.push_back(pair.Points(matches[i]));
    Eigen::Matrix3d H;
    if (!HomographyFromPoints(on_plane, &H)) break;
    const double score = ScoreHomography(points, H, max_error_px);
    if (score < best_score) break;
    best_score = score;
    best = H;
  }
  return best;
}

}  // namespace cairn::internal
