#include "cairn/robust/sampson_kernels.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <limits>

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
struct SampsonUnits {
  SampsonUnits(const PointPairs& points, double unit_px) {
    auto square = [](float x) { return x * x; };
    const auto unit_float = static_cast<float>(unit_px);
    ratio = square(points.focal2_px() / points.focal1_px());
    unit = square(unit_float / points.focal2_px());
    f2 = square(points.focal2_px() / unit_float);
  }
  float ratio, unit, f2;
};

// Squared focal lengths, over the squared unit of the errors.
struct SquaredFocals {
  float f1, f2;
};

// A pose and the directions in which its translation may move, as floats.
struct PoseArguments {
  float R[9];
  float t[3];
  float tangent[6];  // two columns
};

// Sums of AccumulateSampson: lower triangle of the hessian by rows, gradient, cost.
inline constexpr int kNumSums = 15 + 5 + 1;

}  // namespace cairn::internal
#endif

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

using internal::kNumSums;
using internal::Matrix9f;
using internal::PoseArguments;
using internal::SampsonUnits;
using internal::SquaredFocals;

// Algebraic error and squared gradient of 16 / kParts pairs.
struct EpipolarTerms {
  V C, S;
};

HWY_INLINE EpipolarTerms Epipolar(const PointPairs& points, int i, const V* E, V ratio) {
  const V x1 = Load(points.x1() + i), y1 = Load(points.y1() + i);
  const V x2 = Load(points.x2() + i), y2 = Load(points.y2() + i);
  const V a = E[0] * x1 + E[1] * y1 + E[2];
  const V b = E[3] * x1 + E[4] * y1 + E[5];
  const V e = E[6] * x1 + E[7] * y1 + E[8];
  const V c = E[0] * x2 + E[3] * y2 + E[6];
  const V d = E[1] * x2 + E[4] * y2 + E[7];
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
template <class Support, class ShouldStop>
HWY_INLINE bool SumSupports(const PointPairs& points, const Matrix9f& matrix, float ratio_value,
                            const Support& support, const ShouldStop& should_stop, V* sums) {
  V E[9];
  for (int k = 0; k < 9; ++k) E[k] = Const(matrix.v[k]);
  const V ratio = Const(ratio_value);
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
      last[k] = Epipolar(points, i + k * kLanes, E, ratio);
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

double ScoreSampsonKernel(const PointPairs& points, const Matrix9f& matrix,
                          const SampsonUnits& units, float bound) {
  // All supports are times `limit`, the quotient C^2 / S at the threshold.
  const float limit_value = units.unit;
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
  if (!SumSupports(points, matrix, units.ratio, support, should_stop, sums)) return -1.0;
  const float score = SumLanes(sums) / limit_value;
  return score <= bound ? -1.0 : score;
}

double SoftScoreSampsonKernel(const PointPairs& points, const Matrix9f& matrix,
                              const SampsonUnits& units) {
  const V f2 = Const(units.f2), tiny = Const(kTiny);
  const auto support = [=](const EpipolarTerms& terms) HWY_ATTR {
    return terms.S / hn::Max(terms.S + f2 * (terms.C * terms.C), tiny);
  };
  const auto never = [](const float*, int) { return false; };
  V sums[kParts];
  SumSupports(points, matrix, units.ratio, support, never, sums);
  return SumLanes(sums);
}

void SampsonErrorsKernel(const PointPairs& points, const Matrix9f& matrix,
                         const SampsonUnits& units, float* errors) {
  V E[9];
  for (int k = 0; k < 9; ++k) E[k] = Const(matrix.v[k]);
  const V ratio = Const(units.ratio), f2 = Const(units.f2), tiny = Const(kTiny);
  for (int i = 0; i < points.num_blocks() * 16; i += kLanes) {
    const EpipolarTerms terms = Epipolar(points, i, E, ratio);
    const V squared = f2 * (terms.C * terms.C) / hn::Max(terms.S, tiny);
    hn::StoreU(hn::Sqrt(squared), kTag, errors + i);
  }
}

// Squared distance in pixels of the target to M (x, y, 1); huge behind the horizon.
HWY_INLINE V SquaredTransfer(const V* M, V x, V y, V target_x, V target_y, V squared_focal) {
  const V u = M[0] * x + M[1] * y + M[2];
  const V v = M[3] * x + M[4] * y + M[5];
  const V w = M[6] * x + M[7] * y + M[8];
  const auto in_front = w > Const(1e-12f);
  const V inverse = Const(1.0f) / hn::IfThenElse(in_front, w, Const(1.0f));
  const V du = u * inverse - target_x, dv = v * inverse - target_y;
  return hn::IfThenElse(in_front, (du * du + dv * dv) * squared_focal, Const(1e30f));
}

// A homography and its inverse, with the sign that puts the points in front, and squared focals
// over the squared unit of the errors.
struct Transfers {
  V forward[9], backward[9];
  V f1, f2;
};

HWY_INLINE Transfers LoadTransfers(const Matrix9f& H, const Matrix9f& inverse,
                                   const SquaredFocals& focals) {
  Transfers transfers;
  for (int k = 0; k < 9; ++k) {
    transfers.forward[k] = Const(H.v[k]);
    transfers.backward[k] = Const(inverse.v[k]);
  }
  transfers.f1 = Const(focals.f1);
  transfers.f2 = Const(focals.f2);
  return transfers;
}

HWY_INLINE V SquaredHomographyError(const PointPairs& points, int i, const Transfers& transfers) {
  const V x1 = Load(points.x1() + i), y1 = Load(points.y1() + i);
  const V x2 = Load(points.x2() + i), y2 = Load(points.y2() + i);
  return Const(0.5f) * (SquaredTransfer(transfers.forward, x1, y1, x2, y2, transfers.f2) +
                        SquaredTransfer(transfers.backward, x2, y2, x1, y1, transfers.f1));
}

void HomographyErrorsKernel(const PointPairs& points, const Matrix9f& H, const Matrix9f& inverse,
                            const SquaredFocals& focals, float* errors) {
  const Transfers transfers = LoadTransfers(H, inverse, focals);
  for (int i = 0; i < points.num_blocks() * 16; i += kLanes) {
    hn::StoreU(hn::Sqrt(SquaredHomographyError(points, i, transfers)), kTag, errors + i);
  }
}

double ScoreHomographyKernel(const PointPairs& points, const Matrix9f& H, const Matrix9f& inverse,
                             const SquaredFocals& focals) {
  const Transfers transfers = LoadTransfers(H, inverse, focals);
  const V one = Const(1.0f), zero = Const(0.0f);
  V sums[kParts];
  for (int k = 0; k < kParts; ++k) sums[k] = zero;
  const int n = points.size();
  for (int i = 0; i < n; i += 16) {
    for (int k = 0; k < kParts; ++k) {
      const int first = i + k * kLanes;
      const V support = hn::Max(one - SquaredHomographyError(points, first, transfers), zero);
      sums[k] = sums[k] + (i + 16 <= n ? support : support * LaneMask(first, n));
    }
  }
  return SumLanes(sums);
}

struct V3 {
  V x, y, z;
};
HWY_INLINE V3 Cross(const V3& a, const V3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
HWY_INLINE V3 Subtract(const V3& a, const V3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }

// See the derivation in third_party_notes/two_view_refinement.md.
template <RobustLoss kLoss>
void AccumulateKernel(const PointPairs& points, const PoseArguments& pose,
                      const SquaredFocals& focals, float squared_scale, double* sums) {
  const float* R = pose.R;
  const V3 t = {Const(pose.t[0]), Const(pose.t[1]), Const(pose.t[2])};
  const V w1 = Const(1.0f / focals.f1), w2 = Const(1.0f / focals.f2), tiny = Const(kTiny);
  const V zero = Const(0.0f), one = Const(1.0f), s2 = Const(squared_scale);
  const int n = points.size();
  V lane_sums[kNumSums][kParts];
  for (int k = 0; k < kNumSums; ++k) {
    for (int part = 0; part < kParts; ++part) lane_sums[k][part] = zero;
  }
  // Part by part, so that the sums of one part stay in registers.
  for (int part = 0; part < kParts; ++part) {
    V sum[kNumSums];
    for (int k = 0; k < kNumSums; ++k) sum[k] = zero;
    for (int i = part * kLanes; i < n; i += 16) {
      const V x1 = Load(points.x1() + i), y1 = Load(points.y1() + i);
      const V x2 = Load(points.x2() + i), y2 = Load(points.y2() + i);
      const V3 p2 = {x2, y2, one};
      const V3 y = {Const(R[0]) * x1 + Const(R[1]) * y1 + Const(R[2]),
                    Const(R[3]) * x1 + Const(R[4]) * y1 + Const(R[5]),
                    Const(R[6]) * x1 + Const(R[7]) * y1 + Const(R[8])};
      const V a = t.y * y.z - t.z * y.y;  // (a, b): line of x1 in image 2
      const V b = t.z * y.x - t.x * y.z;
      const V3 u = Cross(p2, t);
      const V c = Const(R[0]) * u.x + Const(R[3]) * u.y + Const(R[6]) * u.z;  // line of x2
      const V d = Const(R[1]) * u.x + Const(R[4]) * u.y + Const(R[7]) * u.z;
      const V C = u.x * y.x + u.y * y.y + u.z * y.z;
      const V S = hn::Max(w2 * (a * a + b * b) + w1 * (c * c + d * d), tiny);
      const V inverse_S = one / S;
      const V squared_error = C * C * inverse_S;

      V weight, loss;
      if (kLoss == RobustLoss::kTruncated) {
        const auto inlier = squared_error < s2;
        weight = hn::IfThenElse(inlier, one, zero);
        loss = hn::IfThenElse(inlier, squared_error, s2);
      } else {
        const V ratio = s2 / (s2 + squared_error);
        weight = ratio * ratio;
        loss = squared_error * ratio;
      }
      if (i + kLanes > n) {
        const V mask = LaneMask(i, n);
        weight = weight * mask;
        loss = loss * mask;
      }

      // J sqrt(S): rotation y x q - k w1 z x u, translation y x p - k w1 z x x2.
      const V k = C * inverse_S;
      const V k2 = k * w2, k1 = k * w1;
      const V3 p = {x2 - k2 * a, y2 - k2 * b, one};
      const V3 q = Cross(p, t);
      const V kc = k1 * c, kd = k1 * d;
      const V3 z = {kc * Const(R[0]) + kd * Const(R[1]), kc * Const(R[3]) + kd * Const(R[4]),
                    kc * Const(R[6]) + kd * Const(R[7])};
      const V3 rotation = Subtract(Cross(y, q), Cross(z, u));
      const V3 translation = Subtract(Cross(y, p), Cross(z, p2));
      V J[5] = {rotation.x, rotation.y, rotation.z, zero, zero};
      for (int m = 0; m < 2; ++m) {
        J[3 + m] = translation.x * Const(pose.tangent[m]) +
                   translation.y * Const(pose.tangent[2 + m]) +
                   translation.z * Const(pose.tangent[4 + m]);
      }
      // J carries a factor sqrt(S), as does C: both products below need weight / S.
      const V scaled_weight = weight * inverse_S;
      int index = 0;
      for (int row = 0; row < 5; ++row) {
        const V wJ = scaled_weight * J[row];
        for (int column = 0; column <= row; ++column, ++index) {
          sum[index] = sum[index] + wJ * J[column];
        }
        sum[15 + row] = sum[15 + row] + wJ * C;
      }
      sum[20] = sum[20] + loss;
    }
    for (int k = 0; k < kNumSums; ++k) lane_sums[k][part] = sum[k];
  }
  for (int k = 0; k < kNumSums; ++k) sums[k] = SumLanes(lane_sums[k]);
}

void AccumulateTruncated(const PointPairs& points, const PoseArguments& pose,
                         const SquaredFocals& focals, float squared_scale, double* sums) {
  AccumulateKernel<RobustLoss::kTruncated>(points, pose, focals, squared_scale, sums);
}

void AccumulateGemanMcClure(const PointPairs& points, const PoseArguments& pose,
                            const SquaredFocals& focals, float squared_scale, double* sums) {
  AccumulateKernel<RobustLoss::kGemanMcClure>(points, pose, focals, squared_scale, sums);
}

const char* TargetName() { return hwy::TargetName(HWY_TARGET); }

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace cairn {

HWY_EXPORT(ScoreSampsonKernel);
HWY_EXPORT(SoftScoreSampsonKernel);
HWY_EXPORT(SampsonErrorsKernel);
HWY_EXPORT(HomographyErrorsKernel);
HWY_EXPORT(ScoreHomographyKernel);
HWY_EXPORT(AccumulateTruncated);
HWY_EXPORT(AccumulateGemanMcClure);
HWY_EXPORT(TargetName);

namespace {

using internal::Matrix9f;
using internal::SampsonUnits;
using internal::SquaredFocals;

// Focal lengths in units of `unit_px`, squared.
SquaredFocals FocalsInUnits(const PointPairs& points, double unit_px) {
  const auto f1 = static_cast<float>(points.focal1_px() / unit_px);
  const auto f2 = static_cast<float>(points.focal2_px() / unit_px);
  return {f1 * f1, f2 * f2};
}

// The sign of H for which most points have positive third coordinate: that of its value at the
// centroid of the first ones.
Eigen::Matrix3d WithSignOfPoints(const PointPairs& points, const Eigen::Matrix3d& H) {
  const int n = std::min(points.size(), 16);
  double sum_x = 0.0, sum_y = 0.0;
  for (int i = 0; i < n; ++i) {
    sum_x += points.x1()[i];
    sum_y += points.y1()[i];
  }
  const double w = H(2, 0) * sum_x + H(2, 1) * sum_y + H(2, 2) * n;
  return w < 0.0 ? Eigen::Matrix3d(-H) : H;
}

}  // namespace

double ScoreSampson(const PointPairs& points, const Eigen::Matrix3d& E, double max_error_px,
                    double bound) {
  return HWY_DYNAMIC_DISPATCH(ScoreSampsonKernel)(
      points, Matrix9f(E), SampsonUnits(points, max_error_px), static_cast<float>(bound));
}

double SoftScoreSampson(const PointPairs& points, const Eigen::Matrix3d& E, double scale_px) {
  return HWY_DYNAMIC_DISPATCH(SoftScoreSampsonKernel)(points, Matrix9f(E),
                                                      SampsonUnits(points, scale_px));
}

void SampsonErrors(const PointPairs& points, const Eigen::Matrix3d& E, float* errors_px) {
  HWY_DYNAMIC_DISPATCH(SampsonErrorsKernel)
  (points, Matrix9f(E), SampsonUnits(points, 1.0), errors_px);
}

void HomographyErrors(const PointPairs& points, const Eigen::Matrix3d& H, float* errors_px) {
  const Eigen::Matrix3d oriented = WithSignOfPoints(points, H);
  const Eigen::Matrix3d inverse = oriented.inverse();
  const int n = points.num_blocks() * PointPairs::kBlock;
  if (!inverse.allFinite()) {
    std::fill(errors_px, errors_px + n, std::numeric_limits<float>::infinity());
    return;
  }
  HWY_DYNAMIC_DISPATCH(HomographyErrorsKernel)
  (points, Matrix9f(oriented), Matrix9f(inverse), FocalsInUnits(points, 1.0), errors_px);
}

double ScoreHomography(const PointPairs& points, const Eigen::Matrix3d& H, double max_error_px) {
  const Eigen::Matrix3d oriented = WithSignOfPoints(points, H);
  const Eigen::Matrix3d inverse = oriented.inverse();
  if (!inverse.allFinite()) return 0.0;
  return HWY_DYNAMIC_DISPATCH(ScoreHomographyKernel)(points, Matrix9f(oriented), Matrix9f(inverse),
                                                     FocalsInUnits(points, max_error_px));
}

SampsonNormalEquations AccumulateSampson(const PointPairs& points, const Eigen::Matrix3d& R,
                                         const Eigen::Vector3d& t,
                                         const Eigen::Matrix<double, 3, 2>& tangent,
                                         RobustLoss loss, double scale_px) {
  internal::PoseArguments pose;
  for (int i = 0; i < 9; ++i) pose.R[i] = static_cast<float>(R(i / 3, i % 3));
  for (int i = 0; i < 3; ++i) pose.t[i] = static_cast<float>(t[i]);
  for (int i = 0; i < 6; ++i) pose.tangent[i] = static_cast<float>(tangent(i / 2, i % 2));
  const SquaredFocals focals = FocalsInUnits(points, 1.0);
  const float squared_scale = static_cast<float>(scale_px * scale_px);
  double sums[internal::kNumSums];
  if (loss == RobustLoss::kTruncated) {
    HWY_DYNAMIC_DISPATCH(AccumulateTruncated)(points, pose, focals, squared_scale, sums);
  } else {
    HWY_DYNAMIC_DISPATCH(AccumulateGemanMcClure)(points, pose, focals, squared_scale, sums);
  }
  SampsonNormalEquations equations;
  int index = 0;
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column <= row; ++column, ++index) {
      equations.hessian(row, column) = equations.hessian(column, row) = sums[index];
    }
    equations.gradient[row] = sums[15 + row];
  }
  equations.cost = sums[20] / squared_scale;
  return equations;
}

const char* KernelTargetName() { return HWY_DYNAMIC_DISPATCH(TargetName)(); }

}  // namespace cairn
#endif
