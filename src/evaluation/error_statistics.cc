#include "cairn/evaluation/error_statistics.h"

#include <algorithm>
#include <cmath>

#include "cairn/base/check.h"

namespace cairn {

double RecallAuc(std::vector<double> errors, double threshold) {
  CAIRN_CHECK_GT(threshold, 0.0);
  if (errors.empty()) return 0.0;
  if (!std::is_sorted(errors.begin(), errors.end())) std::sort(errors.begin(), errors.end());
  const double n = static_cast<double>(errors.size());
  double area = 0.0;  // trapezoids through (0, 0) and (k-th error, k / n)
  double last_error = 0.0;
  double last_recall = 0.0;
  for (size_t k = 0; k < errors.size() && errors[k] < threshold; ++k) {
    const double recall = static_cast<double>(k + 1) / n;
    area += 0.5 * (recall + last_recall) * (errors[k] - last_error);
    last_error = errors[k];
    last_recall = recall;
  }
  area += last_recall * (threshold - last_error);
  return area / threshold;
}

double Median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

ErrorStatistics ComputeErrorStatistics(const std::vector<double>& errors) {
  ErrorStatistics statistics;
  statistics.count = static_cast<int>(errors.size());
  if (errors.empty()) return statistics;
  const double n = static_cast<double>(errors.size());
  for (const double error : errors) statistics.mean += error / n;
  double variance = 0.0;
  for (const double error : errors) {
    variance += (error - statistics.mean) * (error - statistics.mean) / n;
  }
  statistics.standard_deviation = std::sqrt(variance);
  statistics.median = Median(errors);
  return statistics;
}

}  // namespace cairn
