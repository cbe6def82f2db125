#include "relative_pose_experiments/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cairn/base/check.h"
#include "cairn/math/angles.h"

namespace cairn::experiments {

PoseErrors ErrorsOf(const Rigid3d& cam2_from_cam1, const Rigid3d& truth) {
  return {RadToDeg(AngleBetween(cam2_from_cam1.rotation, truth.rotation)),
          RadToDeg(AngleBetween(cam2_from_cam1.translation, truth.translation))};
}

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

std::vector<int64_t> LogHistogram(const std::vector<double>& values) {
  constexpr int kNumBins = 42;  // up to 10^3
  std::vector<int64_t> counts(kNumBins);
  for (const double value : values) {
    const double bin = value > 0 ? (std::log10(value) - kLog10Min) / kLog10BinWidth : 0.0;
    ++counts[static_cast<int>(std::clamp(bin, 0.0, kNumBins - 1.0))];
  }
  return counts;
}

}  // namespace cairn::experiments
