#include "robust/sampson_kernels.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <optional>

// These would only cost compile time.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "robust/sampson_kernels.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "base/simd16-inl.h"

#ifndef CAIRN_ROBUST_KERNEL_ARGUMENTS_
#define CAIRN_ROBUST_KERNEL_ARGUMENTS_
namespace cairn::internal {

// A 3x3 matrix, row-major, as floats.
struct Matrix9f {
  explicit Matrix9f(const Eigen::Matrix3d& m) {
    for (int i = 0; i < 9; ++i) v[i] = static_cast<float>(m(i / 3, i % 3));
  }
  float v[9];
};

// The squared error in units is C^2 / (unit S) = f2 C^2 / S, with the algebraic error C = x2^T E x1
// and the squared gradient S = a^2 + b^2 + ratio (c^2 + d^2).
struct SampsonError {
  SampsonError(const PointPairs& points, const Eigen::Matrix3d& matrix, double unit_px)
      : E(matrix) {
    auto square = [](float x) { return x * x; };
    const auto unit_float = static_cast<float>(unit_px);
    ratio = square(points.focal2_px() / points.focal1_px());
    unit = square(unit_float / points.focal2_px());
    f2 = square(points.focal2_px() / unit_float);
  }
  Matrix9f E;
  float ratio, unit, f2;
};

// A homography and its inverse, with the sign that puts the points in front, and squared focal
// lengths over the squared unit of the errors.
struct HomographyError {
  Matrix9f H, inverse;
  float f1, f2;
};

}  // namespace cairn::internal
#endif

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

using internal::HomographyError;
using internal::SampsonError;

// Algebraic error and squared gradient of 16 / kParts pairs.
struct EpipolarTerms {
  V C, S;
};

template <bool kIsWide>
HWY_INLINE EpipolarTerms Epipolar(const PointPairs& points, int i, const V* E, V ratio) {
  const V x1 = Load(points.x1() + i), y1 = Load(points.y1() + i);
  const V x2 = Load(points.x2() + i), y2 = Load(points.y2() + i);
  const V a = E[0] * x1 + E[1] * y1 + E[2];
  const V b = E[3] * x1 + E[4] * y1 + E[5];
  const V e = E[6] * x1 + E[7] * y1 + E[8];
  const V c = E[0] * x2 + E[3] * y2 + E[6];
  const V d = E[1] * x2 + E[4] * y2 + E[7];
  if constexpr (kIsWide) {
    const V weight1 = hn::Abs(Load(points.weight1() + i));
    const V weight2 = hn::Abs(Load(points.weight2() + i));
    const V g = E[2] * x2 + E[5] * y2 + E[8];
    return {x2 * a + y2 * b + e,
            weight2 * (a * a + b * b + e * e) + ratio * weight1 * (c * c + d * d + g * g)};
  }
  return {x2 * a + y2 * b + e, (a * a + b * b) + ratio * (c * c + d * d)};
}

// Smallest squared gradient: keeps 0 / 0 (both points at their epipoles) from being an error.
constexpr float kTiny = 1e-30f;

// Sum of support(terms) over all pairs, each lane for itself; should_stop(sums, n) may end it from
// time to time, with the lanes' sums over the first n pairs. Returns whether the end was reached.
//
// The supports of a block, which wait for a division, are taken while the next block is computed,
// and the lanes are looked at a block after they were stored: the processor has too few registers
// to look ahead over these waits by itself.
template <bool kIsWide, class Support, class ShouldStop>
HWY_INLINE bool SumSupports(const PointPairs& points, const SampsonError& error,
                            const Support& support, const ShouldStop& should_stop, V* sums) {
  V E[9];
  for (int k = 0; k < 9; ++k) E[k] = Const(error.E.v[k]);
  const V ratio = Const(error.ratio);
  EpipolarTerms last[kParts];  // at first those of infinite errors
  for (int k = 0; k < kParts; ++k) {
    sums[k] = Const(0.0f);
    last[k] = {Const(1.0f), Const(0.0f)};
  }
  constexpr int kStopEvery = 16 * 8;
  HWY_ALIGN float lanes[16];
  const int n = points.size();
  for (int i = 0; i < n; i += 16) {
    for (int k = 0; k < kParts; ++k) {
      const V value = support(last[k]);
      last[k] = Epipolar<kIsWide>(points, i + k * kLanes, E, ratio);
      sums[k] = sums[k] + value;
    }
    const int phase = i & (kStopEvery - 1);
    if (phase == kStopEvery - 16) {
      for (int k = 0; k < kParts; ++k) hn::Store(sums[k], kTag, lanes + k * kLanes);
    } else if (phase == 0 && i > 0 && should_stop(lanes, i - 16)) {
      return false;
    }
  }
  const int first = (n - 1) / 16 * 16;
  for (int k = 0; k < kParts; ++k) {
    sums[k] = sums[k] + support(last[k]) * LaneMask(first + k * kLanes, n);
  }
  return true;
}

template <bool kIsWide>
HWY_INLINE double ScoreSampsonOf(const PointPairs& points, const SampsonError& error, float bound) {
  // All supports are times `limit`, the quotient C^2 / S at the threshold.
  const float limit_value = error.unit;
  const V limit = Const(limit_value), zero = Const(0.0f), tiny = Const(kTiny);
  const auto support = [=](const EpipolarTerms& terms) HWY_ATTR {
    return hn::Max(limit - terms.C * terms.C / hn::Max(terms.S, tiny), zero);
  };
  const float scaled_bound = bound * limit_value;
  const int n = points.size();
  const auto should_stop = [=](const float* lanes, int num_done) HWY_ATTR {
    V parts[kParts];
    for (int k = 0; k < kParts; ++k) parts[k] = Load(lanes + k * kLanes);
    return SumLanes(parts) + static_cast<float>(n - num_done) * limit_value <= scaled_bound;
  };
  V sums[kParts];
  if (!SumSupports<kIsWide>(points, error, support, should_stop, sums)) return -1.0;
  const float score = SumLanes(sums) / limit_value;
  return score <= bound ? -1.0 : score;
}

double ScoreSampsonKernel(const PointPairs& points, const SampsonError& error, float bound) {
  if (points.is_wide()) return ScoreSampsonOf<true>(points, error, bound);
  return ScoreSampsonOf<false>(points, error, bound);
}

template <bool kIsWide>
HWY_INLINE double SoftScoreSampsonOf(const PointPairs& points, const SampsonError& error) {
  const V f2 = Const(error.f2), tiny = Const(kTiny);
  const auto support = [=](const EpipolarTerms& terms) HWY_ATTR {
    return terms.S / hn::Max(terms.S + f2 * (terms.C * terms.C), tiny);
  };
  const auto never = [](const float*, int) { return false; };
  V sums[kParts];
  SumSupports<kIsWide>(points, error, support, never, sums);
  return SumLanes(sums);
}

double SoftScoreSampsonKernel(const PointPairs& points, const SampsonError& error) {
  if (points.is_wide()) return SoftScoreSampsonOf<true>(points, error);
  return SoftScoreSampsonOf<false>(points, error);
}

template <bool kIsWide>
HWY_INLINE void SampsonErrorsOf(const PointPairs& points, const SampsonError& error,
                                float* errors) {
  V E[9];
  for (int k = 0; k < 9; ++k) E[k] = Const(error.E.v[k]);
  const V ratio = Const(error.ratio), f2 = Const(error.f2), tiny = Const(kTiny);
  for (int i = 0; i < points.num_blocks() * 16; i += kLanes) {
    const EpipolarTerms terms = Epipolar<kIsWide>(points, i, E, ratio);
    const V squared = f2 * (terms.C * terms.C) / hn::Max(terms.S, tiny);
    hn::StoreU(hn::Sqrt(squared), kTag, errors + i);
  }
}

void SampsonErrorsKernel(const PointPairs& points, const SampsonError& error, float* errors) {
  if (points.is_wide()) return SampsonErrorsOf<true>(points, error, errors);
  SampsonErrorsOf<false>(points, error, errors);
}

struct Points {
  V x, y;
};

// Squared distance in pixels of the target to M (x, y, 1); huge behind the horizon.
HWY_INLINE V SquaredTransfer(const V* M, Points from, Points target, V squared_focal) {
  const V u = M[0] * from.x + M[1] * from.y + M[2];
  const V v = M[3] * from.x + M[4] * from.y + M[5];
  const V w = M[6] * from.x + M[7] * from.y + M[8];
  const auto in_front = w > Const(1e-12f);
  const V inverse = Const(1.0f) / hn::IfThenElse(in_front, w, Const(1.0f));
  const V du = u * inverse - target.x, dv = v * inverse - target.y;
  return hn::IfThenElse(in_front, (du * du + dv * dv) * squared_focal, Const(1e30f));
}

// Weights have the signs of the bearings.
struct Bearings {
  V x, y, weight;
};

// The same of bearings: |m x t|^2 / (|m|^2 weight), the sine of the angle in pixels at the target;
// huge where M turns the bearing away from the target.
HWY_INLINE V SquaredRayTransfer(const V* M, Bearings from, Bearings target, V squared_focal) {
  const V u = M[0] * from.x + M[1] * from.y + M[2];
  const V v = M[3] * from.x + M[4] * from.y + M[5];
  const V w = M[6] * from.x + M[7] * from.y + M[8];
  const V a = v - w * target.y, b = w * target.x - u, c = u * target.y - v * target.x;
  const V dot = u * target.x + v * target.y + w;
  const auto agrees = dot * from.weight * target.weight > Const(0.0f);
  const V norm = hn::Max((u * u + v * v + w * w) * hn::Abs(target.weight), Const(1e-30f));
  return hn::IfThenElse(agrees, (a * a + b * b + c * c) * squared_focal / norm, Const(1e30f));
}

// A HomographyError in vectors.
struct Transfers {
  V forward[9], backward[9];
  V f1, f2;
};

HWY_INLINE Transfers LoadTransfers(const HomographyError& error) {
  Transfers transfers;
  for (int k = 0; k < 9; ++k) {
    transfers.forward[k] = Const(error.H.v[k]);
    transfers.backward[k] = Const(error.inverse.v[k]);
  }
  transfers.f1 = Const(error.f1);
  transfers.f2 = Const(error.f2);
  return transfers;
}

template <bool kIsWide>
HWY_INLINE V SquaredHomographyError(const PointPairs& points, int i, const Transfers& transfers) {
  const Points p1 = {Load(points.x1() + i), Load(points.y1() + i)};
  const Points p2 = {Load(points.x2() + i), Load(points.y2() + i)};
  if constexpr (kIsWide) {
    const Bearings b1 = {p1.x, p1.y, Load(points.weight1() + i)};
    const Bearings b2 = {p2.x, p2.y, Load(points.weight2() + i)};
    return Const(0.5f) * (SquaredRayTransfer(transfers.forward, b1, b2, transfers.f2) +
                          SquaredRayTransfer(transfers.backward, b2, b1, transfers.f1));
  }
  return Const(0.5f) * (SquaredTransfer(transfers.forward, p1, p2, transfers.f2) +
                        SquaredTransfer(transfers.backward, p2, p1, transfers.f1));
}

template <bool kIsWide>
HWY_INLINE void HomographyErrorsOf(const PointPairs& points, const HomographyError& error,
                                   float* errors) {
  const Transfers transfers = LoadTransfers(error);
  for (int i = 0; i < points.num_blocks() * 16; i += kLanes) {
    hn::StoreU(hn::Sqrt(SquaredHomographyError<kIsWide>(points, i, transfers)), kTag, errors + i);
  }
}

void HomographyErrorsKernel(const PointPairs& points, const HomographyError& error, float* errors) {
  if (points.is_wide()) return HomographyErrorsOf<true>(points, error, errors);
  HomographyErrorsOf<false>(points, error, errors);
}

template <bool kIsWide>
HWY_INLINE double ScoreHomographyOf(const PointPairs& points, const HomographyError& error) {
  const Transfers transfers = LoadTransfers(error);
  const V one = Const(1.0f), zero = Const(0.0f);
  V sums[kParts];
  for (int k = 0; k < kParts; ++k) sums[k] = zero;
  const int n = points.size();
  for (int i = 0; i < n; i += 16) {
    for (int k = 0; k < kParts; ++k) {
      const int first = i + k * kLanes;
      const V support =
          hn::Max(one - SquaredHomographyError<kIsWide>(points, first, transfers), zero);
      sums[k] = sums[k] + (i + 16 <= n ? support : support * LaneMask(first, n));
    }
  }
  return SumLanes(sums);
}

double ScoreHomographyKernel(const PointPairs& points, const HomographyError& error) {
  if (points.is_wide()) return ScoreHomographyOf<true>(points, error);
  return ScoreHomographyOf<false>(points, error);
}

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace cairn {

HWY_EXPORT(ScoreSampsonKernel);
HWY_EXPORT(SoftScoreSampsonKernel);
HWY_EXPORT(SampsonErrorsKernel);
HWY_EXPORT(HomographyErrorsKernel);
HWY_EXPORT(ScoreHomographyKernel);

namespace {

using internal::HomographyError;
using internal::SampsonError;

// The sign of H for which most points have positive third coordinate: that of its value at the
// centroid of the first ones; for wide pairs, that which does not turn most of the first ones away.
Eigen::Matrix3d WithSignOfPoints(const PointPairs& points, const Eigen::Matrix3d& H) {
  const int n = std::min(points.size(), 16);
  if (points.is_wide()) {
    int balance = 0;
    for (int i = 0; i < n; ++i) balance += points.Ray2(i).dot(H * points.Ray1(i)) > 0.0 ? 1 : -1;
    return balance < 0 ? Eigen::Matrix3d(-H) : H;
  }
  double sum_x = 0.0, sum_y = 0.0;
  for (int i = 0; i < n; ++i) {
    sum_x += points.x1()[i];
    sum_y += points.y1()[i];
  }
  const double w = H(2, 0) * sum_x + H(2, 1) * sum_y + H(2, 2) * n;
  return w < 0.0 ? Eigen::Matrix3d(-H) : H;
}

// nullopt: H has no inverse.
std::optional<HomographyError> ErrorOf(const PointPairs& points, const Eigen::Matrix3d& H,
                                       double unit_px) {
  const Eigen::Matrix3d oriented = WithSignOfPoints(points, H);
  const Eigen::Matrix3d inverse = oriented.inverse();
  if (!inverse.allFinite()) return std::nullopt;
  const auto f1 = static_cast<float>(points.focal1_px() / unit_px);
  const auto f2 = static_cast<float>(points.focal2_px() / unit_px);
  return HomographyError{internal::Matrix9f(oriented), internal::Matrix9f(inverse), f1 * f1,
                         f2 * f2};
}

}  // namespace

double ScoreSampson(const PointPairs& points, const Eigen::Matrix3d& E, double max_error_px,
                    double bound) {
  return HWY_DYNAMIC_DISPATCH(ScoreSampsonKernel)(points, SampsonError(points, E, max_error_px),
                                                  static_cast<float>(bound));
}

double SoftScoreSampson(const PointPairs& points, const Eigen::Matrix3d& E, double scale_px) {
  return HWY_DYNAMIC_DISPATCH(SoftScoreSampsonKernel)(points, SampsonError(points, E, scale_px));
}

void SampsonErrors(const PointPairs& points, const Eigen::Matrix3d& E, float* errors_px) {
  HWY_DYNAMIC_DISPATCH(SampsonErrorsKernel)
  (points, SampsonError(points, E, 1.0), errors_px);
}

void HomographyErrors(const PointPairs& points, const Eigen::Matrix3d& H, float* errors_px) {
  if (const auto error = ErrorOf(points, H, 1.0)) {
    HWY_DYNAMIC_DISPATCH(HomographyErrorsKernel)(points, *error, errors_px);
  } else {
    const int n = points.num_blocks() * PointPairs::kBlock;
    std::fill_n(errors_px, n, std::numeric_limits<float>::infinity());
  }
}

double ScoreHomography(const PointPairs& points, const Eigen::Matrix3d& H, double max_error_px) {
  const auto error = ErrorOf(points, H, max_error_px);
  return error ? HWY_DYNAMIC_DISPATCH(ScoreHomographyKernel)(points, *error) : 0.0;
}

}  // namespace cairn
#endif
