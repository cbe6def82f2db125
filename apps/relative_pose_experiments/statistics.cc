#include "relative_pose_experiments/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cairn/base/check.h"

namespace cairn::experiments {

double Quantile(std::vector<double> values, double q) {
  CAIRN_CHECK(q >= 0 && q <= 1);
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto rank = static_cast<int64_t>(std::ceil(q * static_cast<double>(values.size()))) - 1;
  const auto nth = values.begin() + std::max<int64_t>(rank, 0);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double ShareBelow(const std::vector<double>& values, double limit) {
  if (values.empty()) return 0;
  const auto count =
      std::count_if(values.begin(), values.end(), [limit](double value) { return value < limit; });
  return static_cast<double>(count) / static_cast<double>(values.size());
}

LogHistogram MakeLogHistogram(const std::vector<double>& values) {
  LogHistogram histogram;
  constexpr int kNumBins = 42;  // up to 10^3
  histogram.counts.assign(kNumBins, 0);
  for (const double value : values) {
    const double bin =
        value > 0 ? (std::log10(value) - histogram.log10_min) / histogram.bin_width : 0.0;
    ++histogram.counts[static_cast<int>(std::clamp(bin, 0.0, kNumBins - 1.0))];
  }
  return histogram;
}

}  // namespace cairn::experiments
