#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <map>
#include <vector>

#include "cairn/base/types.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"

namespace cairn {

using Rotations = std::map<image_t, Eigen::Quaterniond>;

// Errors (degrees, by id) of the images both have, after the one rotation of the world that aligns
// them best: the mode of what single images say, refined by its neighborhood's mean.
inline std::map<image_t, double> AlignedRotationErrorsDeg(const Rotations& estimate,
                                                          const Rotations& truth) {
  std::map<image_t, Eigen::Quaterniond> offsets;  // estimate^-1 * truth
  for (const auto& [id, rotation] : estimate) {
    if (truth.count(id) > 0) offsets[id] = rotation.conjugate() * truth.at(id);
  }
  const auto errors_of = [&](const Eigen::Quaterniond& alignment) {
    std::map<image_t, double> errors;
    for (const auto& [id, q] : offsets) errors[id] = RadToDeg(AngleBetween(alignment, q));
    return errors;
  };
  const auto median_of = [&](const Eigen::Quaterniond& alignment) {
    std::vector<double> values;
    for (const auto& [id, error] : errors_of(alignment)) values.push_back(error);
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    return values[values.size() / 2];
  };
  Eigen::Quaterniond best = Eigen::Quaterniond::Identity();
  double best_median = 1e9;
  for (const auto& [id, q] : offsets) {
    const double median = median_of(q);
    if (median < best_median) {
      best_median = median;
      best = q;
    }
  }
  for (int iteration = 0; iteration < 20; ++iteration) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double weight = 0;
    for (const auto& [id, q] : offsets) {
      const Eigen::Vector3d step = LogSO3(best.conjugate() * q);
      const double w = 1.0 / std::max(step.norm(), 1e-3);
      sum += w * step;
      weight += w;
    }
    best = best * ExpSO3(sum / weight);
  }
  return errors_of(best);
}

struct ErrorSummary {
  double mean = 0, median = 0, max = 0;
  double FractionBelow(double limit) const {
    const auto last = std::lower_bound(sorted.begin(), sorted.end(), limit);
    return static_cast<double>(last - sorted.begin()) / static_cast<double>(sorted.size());
  }
  std::vector<double> sorted;
};

inline ErrorSummary Summarize(const std::map<image_t, double>& errors) {
  ErrorSummary s;
  for (const auto& [id, error] : errors) {
    s.sorted.push_back(error);
    s.mean += error / static_cast<double>(errors.size());
  }
  std::sort(s.sorted.begin(), s.sorted.end());
  if (!s.sorted.empty()) {
    s.median = s.sorted[s.sorted.size() / 2];
    s.max = s.sorted.back();
  }
  return s;
}

}  // namespace cairn
