#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// log10 of the expected number of models as good as this that unrelated images give: `num_inliers`
// of `num_matches` within a band of probability `chance`, for models fixed by `sample_size` of them
// (a-contrario RANSAC: Moisan and Stival, IJCV 2004, eq. for the number of false alarms):
//   NFA = num_models (n - s) C(n, k) C(k, s) chance^(k - s).
double Log10NumFalseAlarms(int num_matches, int num_inliers, int sample_size, int num_models,
                           double chance);

// The probability that two unrelated points of this pair fall within max_error_px of E: measured by
// pairing every first point with the second points of other matches, so that it knows how the
// points are spread; smoothed by the band's share of the image area.
double ChanceOfInlier(const PreparedPair& pair, const Eigen::Matrix3d& E, double max_error_px,
                      PointPairs* scratch);

// The number of matches (indices into pair.points) that differ in position, by cells of a few
// thresholds in both images; of many matches, some hundreds are looked at.
int EstimateNumDistinct(const PreparedPair& pair, std::span<const int32_t> matches,
                        std::vector<uint64_t>* scratch);

}  // namespace cairn::internal
