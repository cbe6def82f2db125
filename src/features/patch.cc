#include "features/patch.h"

#include <algorithm>
#include <cmath>

#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "features/patch.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "base/simd16-inl.h"

#ifndef CAIRN_FEATURES_PATCH_TABLES_
#define CAIRN_FEATURES_PATCH_TABLES_
namespace cairn::internal {

inline constexpr int kSide = PatchGradient::kSide;
inline constexpr int kCells = 4;
inline constexpr int kSiftAngles = 8;
inline constexpr float kCellSize = 3.0f;

// Weights of the grid's points.
struct PatchTables {
  PatchTables() {
    for (int i = 0; i < kSide; ++i) {
      const float u = PatchGradient::At(i);
      units[i] = u;
      shape[i] = std::exp(-0.5f * u * u / (kCellSize * kCellSize));
      angle[i] = std::exp(-0.5f * u * u / (0.25f * kCellSize * kCellSize));
      for (int cell = 0; cell < kCells; ++cell) {
        const float distance = std::abs(u / kCellSize - (static_cast<float>(cell) - 1.5f));
        cells[cell][i] =
            std::max(0.0f, 1 - distance) * std::exp(-0.5f * u * u / (4 * kCellSize * kCellSize));
      }
    }
  }

  alignas(64) float units[kSide];          // coordinates
  alignas(64) float shape[kSide];          // a Gaussian of one cell
  alignas(64) float angle[kSide];          // a Gaussian of half a cell
  alignas(64) float cells[kCells][kSide];  // linear in the distance to a cell, a Gaussian of two
};

// Where a grid lies: the position of its point (u, v) is center + u * axis1 + v * axis2.
struct PatchPlace {
  float x, y, a11, a12, a21, a22;
};

}  // namespace cairn::internal
#endif

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

using internal::kCells;
using internal::kSide;
using internal::kSiftAngles;
using internal::PatchPlace;
using internal::PatchTables;

inline constexpr hn::RebindToSigned<Tag> kInts;

// Between the four pixels from `at` on.
HWY_INLINE V Bilinear(const Plane& plane, hn::Vec<decltype(kInts)> at, V fx, V fy) {
  const float* const data = plane.data.get();
  const int stride = plane.stride;
  const V v00 = hn::GatherIndex(kTag, data, at), v01 = hn::GatherIndex(kTag, data + 1, at);
  const V v10 = hn::GatherIndex(kTag, data + stride, at),
          v11 = hn::GatherIndex(kTag, data + stride + 1, at);
  const V upper = v00 + fx * (v01 - v00), lower = v10 + fx * (v11 - v10);
  return upper + fy * (lower - upper);
}

void SampleKernel(const Plane& below, const Plane& above, float share_above,
                  const PatchPlace& place, const PatchTables& tables, float* values) {
  // From where the next pixel is within the plane (of large ones 0.001 is nothing).
  const auto last = [](int size) {
    const auto end = static_cast<float>(size);
    return Const(std::min(end - 1.001f, std::nextafter(end - 1, 0.0f)));
  };
  const V zero = Const(0), last_x = last(below.width), last_y = last(below.height);
  for (int j = 0; j < kSide; ++j) {
    const V row_x = Const(place.x + place.a12 * tables.units[j]);
    const V row_y = Const(place.y + place.a22 * tables.units[j]);
    for (int i = 0; i < kSide; i += kLanes) {
      const V u = Load(tables.units + i);
      const V x = hn::Min(hn::Max(row_x + Const(place.a11) * u, zero), last_x);
      const V y = hn::Min(hn::Max(row_y + Const(place.a21) * u, zero), last_y);
      const auto left = hn::ConvertTo(kInts, x), top = hn::ConvertTo(kInts, y);
      const V fx = x - hn::ConvertTo(kTag, left), fy = y - hn::ConvertTo(kTag, top);
      const auto at = top * hn::Set(kInts, below.stride) + left;
      const V value = Bilinear(below, at, fx, fy);
      const V mixed = value + Const(share_above) * (Bilinear(above, at, fx, fy) - value);
      hn::Store(mixed, kTag, values + j * kSide + i);
    }
  }
}

// Central differences; the values' first and last columns and rows have none.
void GradientKernel(const float* values, float* gradient_x, float* gradient_y) {
  const V half = Const(0.5f);
  for (int j = 1; j < kSide - 1; ++j) {
    for (int i = 0; i < kSide; i += kLanes) {
      const float* p = values + j * kSide + i;
      hn::Store(half * (LoadU(p + 1) - LoadU(p - 1)), kTag, gradient_x + j * kSide + i);
      hn::Store(half * (Load(p + kSide) - Load(p - kSide)), kTag, gradient_y + j * kSide + i);
    }
    for (float* g : {gradient_x + j * kSide, gradient_y + j * kSide}) g[0] = g[kSide - 1] = 0;
  }
}

void MomentsKernel(const PatchGradient& gradient, const PatchTables& tables, float* moments) {
  V xx[kParts], xy[kParts], yy[kParts];
  for (int k = 0; k < kParts; ++k) xx[k] = xy[k] = yy[k] = Const(0);
  for (int j = 0; j < kSide; ++j) {
    for (int i = 0; i < kSide; i += kLanes) {
      const int k = i / kLanes % kParts;
      const V gx = Load(gradient.x + j * kSide + i), gy = Load(gradient.y + j * kSide + i);
      const V weight = Const(tables.shape[j]) * Load(tables.shape + i);
      xx[k] = xx[k] + weight * gx * gx;
      xy[k] = xy[k] + weight * gx * gy;
      yy[k] = yy[k] + weight * gy * gy;
    }
  }
  moments[0] = SumLanes(xx);
  moments[1] = SumLanes(xy);
  moments[2] = SumLanes(yy);
}

// atan2(y, x) in turns, from 0 to 1; an error of 2e-6 turns. The polynomial is the minimax one of
// degree 9 of atan on [0, 1] (Abramowitz and Stegun, 4.4.49).
HWY_INLINE V Turns(V y, V x) {
  const V ax = hn::Abs(x), ay = hn::Abs(y);
  const V ratio = hn::Min(ax, ay) / hn::Max(hn::Max(ax, ay), Const(1e-30f));
  const V r2 = ratio * ratio;
  V angle = Const(0.0208351f);
  for (const float c : {-0.0851330f, 0.1801410f, -0.3302995f, 0.9998660f}) {
    angle = angle * r2 + Const(c);
  }
  angle = angle * ratio * Const(0.15915494f);
  angle = hn::IfThenElse(ay > ax, Const(0.25f) - angle, angle);
  angle = hn::IfThenElse(x < Const(0), Const(0.5f) - angle, angle);
  return hn::IfThenElse(y < Const(0), Const(1.0f) - angle, angle);
}

// Bin of every gradient of the grid, and what it adds there.
void AnglesKernel(const PatchGradient& gradient, const PatchTables& tables, float num_bins,
                  float* bins, float* weights) {
  for (int j = 0; j < kSide; ++j) {
    for (int i = 0; i < kSide; i += kLanes) {
      const int at = j * kSide + i;
      const V gx = Load(gradient.x + at), gy = Load(gradient.y + at);
      const V weight = Const(tables.angle[j]) * Load(tables.angle + i);
      hn::Store(Turns(gy, gx) * Const(num_bins), kTag, bins + at);
      hn::Store(weight * hn::Sqrt(gx * gx + gy * gy), kTag, weights + at);
    }
  }
}

// What each angle of SIFT gets of each gradient is a grid; a cell is its weighted sum, first over
// rows, then over columns.
void SiftKernel(const PatchGradient& gradient, const PatchTables& tables, float* histogram) {
  HWY_ALIGN float sums[kCells][kSiftAngles][kSide] = {};
  for (int j = 1; j < kSide - 1; ++j) {
    for (int i = 0; i < kSide; i += kLanes) {
      const V gx = Load(gradient.x + j * kSide + i), gy = Load(gradient.y + j * kSide + i);
      const V norm = hn::Sqrt(gx * gx + gy * gy);
      const V turn = Turns(hn::Neg(gy), gx) * Const(kSiftAngles);
      for (int a = 0; a < kSiftAngles; ++a) {
        V distance = hn::Abs(turn - Const(static_cast<float>(a)));
        if (a == 0) distance = hn::Min(distance, Const(kSiftAngles) - distance);
        const V share = norm * hn::Max(Const(1) - distance, Const(0));
        for (int cell = 0; cell < kCells; ++cell) {
          const float weight = tables.cells[cell][j];
          if (weight == 0) continue;
          float* sum = sums[cell][a] + i;
          hn::Store(Load(sum) + Const(weight) * share, kTag, sum);
        }
      }
    }
  }
  for (int row = 0; row < kCells; ++row) {
    for (int column = 0; column < kCells; ++column) {
      for (int a = 0; a < kSiftAngles; ++a) {
        V parts[kParts];
        for (int k = 0; k < kParts; ++k) parts[k] = Const(0);
        for (int i = 0; i < kSide; i += kLanes) {
          V& part = parts[i / kLanes % kParts];
          part = part + Load(tables.cells[column] + i) * Load(sums[row][a] + i);
        }
        histogram[(row * kCells + column) * kSiftAngles + a] = SumLanes(parts);
      }
    }
  }
}

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace cairn {
HWY_EXPORT(SampleKernel);
HWY_EXPORT(GradientKernel);
HWY_EXPORT(MomentsKernel);
HWY_EXPORT(AnglesKernel);
HWY_EXPORT(SiftKernel);
namespace {

const internal::PatchTables kTables;

}  // namespace

PatchGradient SampleGradient(const Plane& below, const Plane& above, double share_above,
                             const Eigen::Vector2d& center, const Eigen::Matrix2d& M) {
  constexpr int kSide = PatchGradient::kSide;
  alignas(64) float padded[kSide * kSide + 32];  // a vector before and after
  float* const values = padded + 16;
  const Eigen::Matrix2f A = M.cast<float>();
  const internal::PatchPlace place = {static_cast<float>(center.x()),
                                      static_cast<float>(center.y()),
                                      A(0, 0),
                                      A(0, 1),
                                      A(1, 0),
                                      A(1, 1)};
  HWY_DYNAMIC_DISPATCH(SampleKernel)
  (below, above, static_cast<float>(share_above), place, kTables, values);
  PatchGradient gradient;
  HWY_DYNAMIC_DISPATCH(GradientKernel)(values, gradient.x, gradient.y);
  for (float* g : {gradient.x, gradient.y}) {
    std::fill_n(g, kSide, 0.0f);
    std::fill_n(g + (kSide - 1) * kSide, kSide, 0.0f);
  }
  return gradient;
}

Eigen::Matrix2d SecondMoments(const PatchGradient& gradient) {
  float m[3];
  HWY_DYNAMIC_DISPATCH(MomentsKernel)(gradient, kTables, m);
  return (Eigen::Matrix2d() << m[0], m[1], m[1], m[2]).finished();
}

std::array<float, kNumAngles> AngleHistogram(const PatchGradient& gradient) {
  constexpr int kPoints = PatchGradient::kSide * PatchGradient::kSide;
  alignas(64) float bins[kPoints], weights[kPoints];
  HWY_DYNAMIC_DISPATCH(AnglesKernel)(gradient, kTables, kNumAngles, bins, weights);
  std::array<float, kNumAngles> histogram{};
  for (int i = 0; i < kPoints; ++i) {
    histogram[static_cast<int>(bins[i] + 0.5f) % kNumAngles] += weights[i];
  }
  return histogram;
}

std::array<float, kDescriptorSize> SiftHistogram(const PatchGradient& gradient) {
  std::array<float, kDescriptorSize> histogram;
  HWY_DYNAMIC_DISPATCH(SiftKernel)(gradient, kTables, histogram.data());
  Eigen::Map<Eigen::Matrix<float, kDescriptorSize, 1>> vector(histogram.data());
  vector /= std::max(vector.norm(), 1e-12f);
  vector = vector.cwiseMin(0.2f);
  return histogram;
}

}  // namespace cairn
#endif
