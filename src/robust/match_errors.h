#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "cairn/math/median.h"
#include "robust/sampson_kernels.h"

namespace cairn {

// The errors of all matches at a model, pixels, and which of them are small. Memory is used again.
class MatchErrors {
 public:
  MatchErrors() = default;
  MatchErrors(const PointPairs& points, const Eigen::Matrix3d& E) { SetSampson(points, E); }

  void SetSampson(const PointPairs& points, const Eigen::Matrix3d& E) {
    SampsonErrors(points, E, Resize(points));
  }
  void SetHomography(const PointPairs& points, const Eigen::Matrix3d& H) {
    HomographyErrors(points, H, Resize(points));
  }

  std::span<const float> values() const { return {values_.data(), static_cast<size_t>(size_)}; }
  float operator[](int i) const { return values_[i]; }

  int CountBelow(double max_error_px) const {
    return static_cast<int>(std::count_if(values_.begin(), values_.begin() + size_,
                                          [=](float e) { return e < max_error_px; }));
  }
  std::vector<int32_t> Below(double max_error_px) const {
    std::vector<int32_t> indices;
    indices.reserve(size_);
    for (int i = 0; i < size_; ++i) {
      if (values_[i] < max_error_px) indices.push_back(i);
    }
    return indices;
  }
  double MedianOf(std::span<const int32_t> indices) const {
    std::vector<double> errors;
    errors.reserve(indices.size());
    for (const int32_t i : indices) errors.push_back(values_[i]);
    return UpperMedian(std::move(errors));
  }

 private:
  float* Resize(const PointPairs& points) {
    size_ = points.size();
    values_.resize(static_cast<size_t>(points.num_blocks()) * PointPairs::kBlock);
    return values_.data();
  }

  std::vector<float> values_;  // whole blocks
  int size_ = 0;
};

}  // namespace cairn
