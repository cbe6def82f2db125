#pragma once

#include <cstdint>
#include <span>

#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// What fixes a model.
struct ModelKind {
  int sample_size;
  int num_models;       // of a sample
  double chance = 1.0;  // that a match near a wrong model passes what else is asked of it
};
// Matches are to be in front of both cameras, too: half of those near their epipolar lines are, or
// fewer.
inline constexpr ModelKind kEssential = {5, 10, 0.5};
inline constexpr ModelKind kFundamental = {7, 3};

// log10 of the expected number of models as good as this that unrelated images give: `num_inliers`
// of `num_matches` within a band of probability `chance`, for models fixed by sample_size of them
// (a-contrario RANSAC: Moisan and Stival, IJCV 2004, eq. for the number of false alarms):
//   NFA = num_models (n - s) C(n, k) C(k, s) chance^(k - s).
double Log10NumFalseAlarms(int num_matches, int num_inliers, const ModelKind& kind, double chance);

// The same of a model with these inliers (indices into pair.points): by ChanceOfInlier, and with
// matches of the same two spots as one piece of evidence, however many there are.
double Log10NumFalseAlarms(const PreparedPair& pair, const Eigen::Matrix3d& E,
                           std::span<const int32_t> inliers, const ModelKind& kind);

// The probability that two unrelated points of this pair fall within max_error_px of E: measured by
// pairing every first point with the second points of other matches, so that it knows how the
// points are spread; smoothed by the band's share of the image area.
double ChanceOfInlier(const PreparedPair& pair, const Eigen::Matrix3d& E, double max_error_px);

// Whether, of the matches that are off the homography H of rays (a plane's, or a rotation) by more
// than noise (NoiseScalePx), the inliers of a model with an epipole are more than chance gives.
bool HasParallax(const PreparedPair& pair, const Eigen::Matrix3d& H,
                 std::span<const int32_t> inliers, double noise_px, double min_log10_evidence);

// The number of matches (indices into pair.points) that differ in position, by cells of a few
// thresholds in both images; of many matches, some hundreds are looked at.
int EstimateNumDistinct(const PreparedPair& pair, std::span<const int32_t> matches);

}  // namespace cairn::internal
