#pragma once

#include <cstdint>
#include <vector>

#include "cairn/geometry/rigid3d.h"

namespace cairn::experiments {

// Errors of a relative pose in degrees: angle of the rotation, angle between the directions.
struct PoseErrors {
  double rotation_deg = 180.0;
  double translation_deg = 180.0;
};
PoseErrors ErrorsOf(const Rigid3d& cam2_from_cam1, const Rigid3d& truth);

// The q-quantile (0 <= q <= 1) by the nearest rank; NaN of nothing.
double Quantile(std::vector<double> values, double q);
inline double Median(std::vector<double> values) { return Quantile(std::move(values), 0.5); }
double Mean(const std::vector<double>& values);
// Share of the values below the limit; 0 of nothing.
double ShareBelow(const std::vector<double>& values, double limit);

// Counts over bins of log10(value), of equal width; values outside, zeros among them, go into the
// first or the last bin.
inline constexpr double kLog10Min = -18.0, kLog10BinWidth = 0.5;
std::vector<int64_t> LogHistogram(const std::vector<double>& values);

}  // namespace cairn::experiments
