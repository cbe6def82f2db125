#include <Eigen/Core>
#include <algorithm>
#include <type_traits>

#include "robust/sampson_kernels.h"

// These would only cost compile time.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "robust/normal_equations.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "base/simd16-inl.h"

#ifndef CAIRN_ROBUST_POSE_ARGUMENTS_
#define CAIRN_ROBUST_POSE_ARGUMENTS_
namespace cairn::internal {

// A pose, the directions in which its translation may move (two columns, row-major), weights of
// squared gradients (1 / f^2) and the squared scale of the loss, as floats.
struct PoseArguments {
  float R[9];
  float t[3];
  float tangent[6];
  float w1, w2, squared_scale;
};

// Lower triangle of the hessian by rows, gradient, sum of losses in squared pixels.
inline constexpr int kCostIndex = 15 + 5;
inline constexpr int kNumSums = kCostIndex + 1;

}  // namespace cairn::internal
#endif

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

using internal::kCostIndex;
using internal::kNumSums;
using internal::PoseArguments;

struct V3 {
  V x, y, z;
};
HWY_INLINE V3 Cross(const V3& a, const V3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
HWY_INLINE V3 Subtract(const V3& a, const V3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }

// R (x, y, 1).
HWY_INLINE V3 Rotated(const float* R, V x, V y) {
  return {Const(R[0]) * x + Const(R[1]) * y + Const(R[2]),
          Const(R[3]) * x + Const(R[4]) * y + Const(R[5]),
          Const(R[6]) * x + Const(R[7]) * y + Const(R[8])};
}

// What the derivatives of 16 / kParts pairs are made of; names as in
// third_party_notes/two_view_refinement.md. k2, k1: k times w2, w1; the weight is divided by S.
struct SampsonTerms {
  V y_x, y_y, y_z, u_x, u_y, u_z;  // (GCC copies nested vectors through memory.)
  V C, k2_a, k2_b, k1_c, k1_d;
  V scaled_weight;
};

// With the third components of both lines.
struct WideSampsonTerms : SampsonTerms {
  V k2_e, k1_g;
};

template <bool kIsWide>
using TermsOf = std::conditional_t<kIsWide, WideSampsonTerms, SampsonTerms>;

// Of a squared error: the loss in squared pixels, and its derivative.
struct WeighedLoss {
  V weight, loss;
};

template <RobustLoss kLoss>
HWY_INLINE WeighedLoss LossOf(V squared_error, V s2) {
  if (kLoss == RobustLoss::kTruncated) {
    const auto inlier = squared_error < s2;
    return {hn::IfThenElse(inlier, Const(1.0f), Const(0.0f)),
            hn::IfThenElse(inlier, squared_error, s2)};
  }
  const V ratio = s2 / (s2 + squared_error);
  return {ratio * ratio, squared_error * ratio};
}

// Fills the terms of the pairs from i on; returns their losses in squared pixels.
template <RobustLoss kLoss, bool kIsWide>
HWY_INLINE V ComputeTerms(const PointPairs& points, int i, const PoseArguments& pose,
                          TermsOf<kIsWide>* terms) {
  const float* R = pose.R;
  const V3 t = {Const(pose.t[0]), Const(pose.t[1]), Const(pose.t[2])};
  V w1 = Const(pose.w1), w2 = Const(pose.w2);
  const V one = Const(1.0f);
  const V tiny = Const(1e-30f);  // keeps both points at their epipoles from being 0 / 0
  const V x1 = Load(points.x1() + i), y1 = Load(points.y1() + i);
  const V3 p2 = {Load(points.x2() + i), Load(points.y2() + i), one};
  const V3 y = Rotated(R, x1, y1);
  const V a = t.y * y.z - t.z * y.y;  // (a, b): line of x1 in image 2
  const V b = t.z * y.x - t.x * y.z;
  const V3 u = Cross(p2, t);
  const V c = Const(R[0]) * u.x + Const(R[3]) * u.y + Const(R[6]) * u.z;  // line of x2
  const V d = Const(R[1]) * u.x + Const(R[4]) * u.y + Const(R[7]) * u.z;
  const V C = u.x * y.x + u.y * y.y + u.z * y.z;
  V squared2 = a * a + b * b, squared1 = c * c + d * d;
  V e, g;
  if constexpr (kIsWide) {
    w1 = w1 * hn::Abs(Load(points.weight1() + i));
    w2 = w2 * hn::Abs(Load(points.weight2() + i));
    e = t.x * y.y - t.y * y.x;
    g = Const(R[2]) * u.x + Const(R[5]) * u.y + Const(R[8]) * u.z;
    squared2 = squared2 + e * e;
    squared1 = squared1 + g * g;
  }
  const V S = hn::Max(w2 * squared2 + w1 * squared1, tiny);
  const V inverse_S = one / S;
  const V squared_error = C * C * inverse_S;

  auto [weight, loss] = LossOf<kLoss>(squared_error, Const(pose.squared_scale));
  if (i + kLanes > points.size()) {
    const V mask = LaneMask(i, points.size());
    weight = weight * mask;
    loss = loss * mask;
  }
  const V k = C * inverse_S;
  const V k2 = k * w2, k1 = k * w1;
  terms->y_x = y.x;
  terms->y_y = y.y;
  terms->y_z = y.z;
  terms->u_x = u.x;
  terms->u_y = u.y;
  terms->u_z = u.z;
  terms->C = C;
  terms->k2_a = k2 * a;
  terms->k2_b = k2 * b;
  terms->k1_c = k1 * c;
  terms->k1_d = k1 * d;
  terms->scaled_weight = weight * inverse_S;
  if constexpr (kIsWide) {
    terms->k2_e = k2 * e;
    terms->k1_g = k1 * g;
  }
  return loss;
}

// Adds hessian and gradient of the pairs from i on.
template <bool kIsWide>
HWY_INLINE void AddDerivatives(const PointPairs& points, int i, const PoseArguments& pose,
                               const TermsOf<kIsWide>& terms, V* sum) {
  const float *R = pose.R, *tangent = pose.tangent;
  const V3 t = {Const(pose.t[0]), Const(pose.t[1]), Const(pose.t[2])};
  const V3 p2 = {Load(points.x2() + i), Load(points.y2() + i), Const(1.0f)};
  const V3 y = {terms.y_x, terms.y_y, terms.y_z}, u = {terms.u_x, terms.u_y, terms.u_z};
  V3 p = {p2.x - terms.k2_a, p2.y - terms.k2_b, p2.z};
  if constexpr (kIsWide) p.z = p.z - terms.k2_e;
  const V3 q = Cross(p, t);
  V3 z = {terms.k1_c * Const(R[0]) + terms.k1_d * Const(R[1]),
          terms.k1_c * Const(R[3]) + terms.k1_d * Const(R[4]),
          terms.k1_c * Const(R[6]) + terms.k1_d * Const(R[7])};
  if constexpr (kIsWide) {
    z = {z.x + terms.k1_g * Const(R[2]), z.y + terms.k1_g * Const(R[5]),
         z.z + terms.k1_g * Const(R[8])};
  }
  const V3 rotation = Subtract(Cross(y, q), Cross(z, u));
  const V3 translation = Subtract(Cross(y, p), Cross(z, p2));
  V J[5] = {rotation.x, rotation.y, rotation.z};
  for (int m = 0; m < 2; ++m) {
    J[3 + m] = translation.x * Const(tangent[m]) + translation.y * Const(tangent[2 + m]) +
               translation.z * Const(tangent[4 + m]);
  }
  // J carries a factor sqrt(S), as does C: both products below need weight / S.
  int index = 0;
  for (int row = 0; row < 5; ++row) {
    const V wJ = terms.scaled_weight * J[row];
    for (int column = 0; column <= row; ++column, ++index) {
      sum[index] = sum[index] + wJ * J[column];
    }
    sum[15 + row] = sum[15 + row] + wJ * terms.C;
  }
}

template <RobustLoss kLoss, bool kIsWide>
void AccumulateKernel(const PointPairs& points, const PoseArguments& pose, double* sums) {
  // Divisions of several blocks wait at the same time, before all derivatives of these blocks.
  constexpr int kNumBlocks = 8;
  TermsOf<kIsWide> terms[kNumBlocks];
  const int n = points.size();
  V lane_sums[kNumSums][kParts];
  // Part by part, so that the sums of one part stay in registers.
  for (int part = 0; part < kParts; ++part) {
    V sum[kNumSums];
    for (int k = 0; k < kNumSums; ++k) sum[k] = Const(0.0f);
    for (int first = part * kLanes; first < n; first += 16 * kNumBlocks) {
      const int end = std::min(first + 16 * kNumBlocks, n);
      for (int i = first, block = 0; i < end; i += 16, ++block) {
        sum[kCostIndex] =
            sum[kCostIndex] + ComputeTerms<kLoss, kIsWide>(points, i, pose, &terms[block]);
      }
      for (int i = first, block = 0; i < end; i += 16, ++block) {
        AddDerivatives<kIsWide>(points, i, pose, terms[block], sum);
      }
    }
    for (int k = 0; k < kNumSums; ++k) lane_sums[k][part] = sum[k];
  }
  for (int k = 0; k < kNumSums; ++k) sums[k] = SumLanes(lane_sums[k]);
}

// The last of the sums alone.
template <RobustLoss kLoss, bool kIsWide>
double CostKernel(const PointPairs& points, const PoseArguments& pose) {
  V sum[kParts];
  for (int part = 0; part < kParts; ++part) sum[part] = Const(0.0f);
  for (int i = 0; i < points.size(); i += 16) {
    for (int part = 0; part < kParts; ++part) {
      const int first = i + part * kLanes;
      if (first >= points.size()) break;
      TermsOf<kIsWide> unused;
      sum[part] = sum[part] + ComputeTerms<kLoss, kIsWide>(points, first, pose, &unused);
    }
  }
  return SumLanes(sum);
}

template <bool kIsWide>
void AccumulateOf(const PointPairs& points, RobustLoss loss, const PoseArguments& pose,
                  double* sums) {
  if (loss == RobustLoss::kTruncated) {
    AccumulateKernel<RobustLoss::kTruncated, kIsWide>(points, pose, sums);
  } else {
    AccumulateKernel<RobustLoss::kGemanMcClure, kIsWide>(points, pose, sums);
  }
}

template <bool kIsWide>
double CostOf(const PointPairs& points, RobustLoss loss, const PoseArguments& pose) {
  return loss == RobustLoss::kTruncated
             ? CostKernel<RobustLoss::kTruncated, kIsWide>(points, pose)
             : CostKernel<RobustLoss::kGemanMcClure, kIsWide>(points, pose);
}

void Accumulate(const PointPairs& points, RobustLoss loss, const PoseArguments& pose,
                double* sums) {
  if (points.is_wide()) return AccumulateOf<true>(points, loss, pose, sums);
  AccumulateOf<false>(points, loss, pose, sums);
}

double Cost(const PointPairs& points, RobustLoss loss, const PoseArguments& pose) {
  return points.is_wide() ? CostOf<true>(points, loss, pose) : CostOf<false>(points, loss, pose);
}

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace cairn {

HWY_EXPORT(Accumulate);
HWY_EXPORT(Cost);

namespace {

internal::PoseArguments MakeArguments(const PointPairs& points, const Rigid3d& cam2_from_cam1,
                                      const Eigen::Matrix<double, 3, 2>& tangent, double scale_px) {
  const Eigen::Matrix3d R = cam2_from_cam1.RotationMatrix();
  internal::PoseArguments pose;
  for (int i = 0; i < 9; ++i) pose.R[i] = static_cast<float>(R(i / 3, i % 3));
  for (int i = 0; i < 3; ++i) pose.t[i] = static_cast<float>(cam2_from_cam1.translation[i]);
  for (int i = 0; i < 6; ++i) pose.tangent[i] = static_cast<float>(tangent(i / 2, i % 2));
  pose.w1 = 1.0f / (points.focal1_px() * points.focal1_px());
  pose.w2 = 1.0f / (points.focal2_px() * points.focal2_px());
  pose.squared_scale = static_cast<float>(scale_px * scale_px);
  return pose;
}

}  // namespace

NormalEquations<5> AccumulateSampson(const PointPairs& points, const Rigid3d& cam2_from_cam1,
                                     const Eigen::Matrix<double, 3, 2>& tangent, RobustLoss loss,
                                     double scale_px) {
  const internal::PoseArguments pose = MakeArguments(points, cam2_from_cam1, tangent, scale_px);
  double sums[internal::kNumSums];
  HWY_DYNAMIC_DISPATCH(Accumulate)(points, loss, pose, sums);
  NormalEquations<5> equations;
  int index = 0;
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column <= row; ++column, ++index) {
      equations.hessian(row, column) = equations.hessian(column, row) = sums[index];
    }
    equations.gradient[row] = sums[15 + row];
  }
  equations.cost = sums[internal::kCostIndex] / pose.squared_scale;
  return equations;
}

double SampsonCost(const PointPairs& points, const Rigid3d& cam2_from_cam1, RobustLoss loss,
                   double scale_px) {
  const internal::PoseArguments pose =
      MakeArguments(points, cam2_from_cam1, Eigen::Matrix<double, 3, 2>::Zero(), scale_px);
  return HWY_DYNAMIC_DISPATCH(Cost)(points, loss, pose) / pose.squared_scale;
}

}  // namespace cairn
#endif
