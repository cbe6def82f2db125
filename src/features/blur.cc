#include "features/blur.h"

#include <algorithm>
#include <cmath>
#include <vector>

#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "features/blur.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "base/simd16-inl.h"

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

// sum[x] = taps[0] rows[0][x] + taps[k] (rows[2 k - 1][x] + rows[2 k][x])
void SumRowsKernel(const float* const* rows, const std::vector<float>& taps, int stride,
                   float* sum) {
  const int radius = static_cast<int>(taps.size()) - 1;
  for (int x = 0; x < stride; x += kLanes) {
    V value = Const(taps[0]) * LoadU(rows[0] + x);
    for (int k = 1; k <= radius; ++k) {
      value = value + Const(taps[k]) * (LoadU(rows[2 * k - 1] + x) + LoadU(rows[2 * k] + x));
    }
    hn::StoreU(value, kTag, sum + x);
  }
}

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace cairn {
HWY_EXPORT(SumRowsKernel);
namespace {

// taps[k] weighs the pixels k away.
std::vector<float> GaussianTaps(double sigma) {
  std::vector<float> taps(static_cast<size_t>(std::ceil(4 * sigma)) + 1);
  double sum = 0;
  for (size_t k = 0; k < taps.size(); ++k) {
    const double tap = std::exp(-0.5 * static_cast<double>(k * k) / (sigma * sigma));
    taps[k] = static_cast<float>(tap);
    sum += k == 0 ? tap : 2 * tap;
  }
  for (float& tap : taps) tap = static_cast<float>(tap / sum);
  return taps;
}

}  // namespace

Plane Blur(const Plane& source, double sigma, int step) {
  const std::vector<float> taps = GaussianTaps(sigma);
  const int radius = static_cast<int>(taps.size()) - 1;
  Plane target((source.width + step - 1) / step, (source.height + step - 1) / step);
  // A row between its borders, then both ways of summing are one: of rows, and of the row shifted.
  std::vector<float> padded(source.stride + 2 * radius), blurred(source.stride);
  std::vector<const float*> rows(2 * radius + 1);
  for (int y = 0; y < target.height; ++y) {
    for (int k = 0; k <= radius; ++k) {
      rows[2 * k] = source.Row(std::min(step * y + k, source.height - 1));
      if (k > 0) rows[2 * k - 1] = source.Row(std::max(step * y - k, 0));
    }
    float* const row = padded.data() + radius;
    HWY_DYNAMIC_DISPATCH(SumRowsKernel)(rows.data(), taps, source.stride, row);
    std::fill(padded.data(), row, row[0]);
    std::fill(row + source.width, padded.data() + padded.size(), row[source.width - 1]);
    for (int k = 0; k <= radius; ++k) {
      rows[2 * k] = row + k;
      if (k > 0) rows[2 * k - 1] = row - k;
    }
    float* const result = step == 1 ? target.Row(y) : blurred.data();
    HWY_DYNAMIC_DISPATCH(SumRowsKernel)(rows.data(), taps, source.stride, result);
    if (step == 1) continue;
    for (int x = 0; x < target.width; ++x) target.Row(y)[x] = blurred[step * x];
  }
  return target;
}

}  // namespace cairn
#endif
