#pragma once

#include <vector>

#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// The noise that is allowed for, in thresholds.
inline constexpr double kMaxNoise = 3.0;

// `factor` times the median error of right matches, pixels, by the errors of all matches at a pose
// that was fitted to them: of those within kMaxNoise thresholds, less as many as chance puts there,
// evenly. A fit to few matches is closer than their noise, which is allowed for (Rousseeuw and
// Leroy, 1987: 1 + 5 / (n - p)); that it is the threshold weighs as much as ten matches. At least a
// quarter of the threshold, at most kMaxNoise of it.
double NoiseScalePx(const PreparedPair& pair, const std::vector<float>& errors_px, double factor,
                    std::vector<float>* scratch);

}  // namespace cairn::internal
