#pragma once

#include <cstdint>
#include <vector>

namespace cairn::experiments {

// The q-quantile (0 <= q <= 1) by the nearest rank; NaN of nothing.
double Quantile(std::vector<double> values, double q);
inline double Median(std::vector<double> values) { return Quantile(std::move(values), 0.5); }
double Mean(const std::vector<double>& values);
// Share of the values below the limit; 0 of nothing.
double ShareBelow(const std::vector<double>& values, double limit);

// Counts over bins of equal width of log10(value); what lies outside, zeros among it, goes into the
// first or the last bin.
struct LogHistogram {
  double log10_min = -18.0;
  double bin_width = 0.5;
  std::vector<int64_t> counts;
};
LogHistogram MakeLogHistogram(const std::vector<double>& values);

}  // namespace cairn::experiments
