#include "translation_averaging/quality.h"

#include <algorithm>

#include "cairn/math/median.h"

namespace cairn {
namespace {

double QuantileOf(const std::vector<double>& sorted, double q) {
  const size_t index = static_cast<size_t>(q * static_cast<double>(sorted.size()));
  return sorted[std::min(sorted.size() - 1, index)];
}

}  // namespace

SpreadReport AnalyzeSpread(const Eigen::Matrix3Xd& centers, double min_spread) {
  SpreadReport report;
  if (centers.cols() < 3) return report;
  Eigen::Vector3d median;
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values(centers.cols());
    for (Eigen::Index i = 0; i < centers.cols(); ++i) values[i] = centers(axis, i);
    median[axis] = UpperMedian(values);
  }
  std::vector<double> distances(centers.cols());
  for (Eigen::Index i = 0; i < centers.cols(); ++i) {
    distances[i] = (centers.col(i) - median).norm();
  }
  std::vector<double> sorted = distances;
  std::sort(sorted.begin(), sorted.end());
  const double half = QuantileOf(sorted, 0.5);
  const double most = QuantileOf(sorted, 0.9);
  report.half_over_most = most > 0 ? half / most : 0.0;
  for (size_t i = 0; i < distances.size(); ++i) {
    if (distances[i] * min_spread > half) report.thrown_away.push_back(static_cast<int>(i));
  }
  return report;
}

}  // namespace cairn
