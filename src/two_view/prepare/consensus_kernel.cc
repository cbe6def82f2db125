#include "two_view/prepare/consensus_kernel.h"

#include <algorithm>

#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "two_view/prepare/consensus_kernel.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "base/simd16-inl.h"

#ifndef CAIRN_TWO_VIEW_CONSENSUS_TOLERANCE_
#define CAIRN_TWO_VIEW_CONSENSUS_TOLERANCE_
namespace cairn::internal {
// A prediction may miss by this share of the distance plus as many pixels: surfaces bend, frames
// are rough.
inline constexpr float kRelativeTolerance = 0.25f;
inline constexpr float kTolerancePx = 2.0f;
}  // namespace cairn::internal
#endif

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

using internal::kRelativeTolerance;
using internal::kTolerancePx;

// Nearer matches are the same spot found twice.
constexpr float kMinDistancePx = 3.0f;

struct V2 {
  V x, y;
};
HWY_INLINE V SquaredNorm(V2 v) { return v.x * v.x + v.y * v.y; }

// |to - A from|^2
HWY_INLINE V SquaredMiss(const V* A, V2 from, V2 to) {
  return SquaredNorm(
      {to.x - (A[0] * from.x + A[1] * from.y), to.y - (A[2] * from.x + A[3] * from.y)});
}

double CountConsensusKernel(const internal::ConsensusColumns& columns, float radius1_px,
                            float radius2_px, float* counts) {
  const int n = columns.size, stride = columns.stride;
  const float* x1 = columns.data;
  const float* y1 = x1 + stride;
  const float* x2 = y1 + stride;
  const float* y2 = x2 + stride;
  const float* A = y2 + stride;
  const V squared_radius1 = Const(radius1_px * radius1_px);
  const V squared_radius2 = Const(radius2_px * radius2_px);
  const V squared_min = Const(kMinDistancePx * kMinDistancePx);
  const V relative = Const(kRelativeTolerance * kRelativeTolerance);
  const V absolute = Const(kTolerancePx * kTolerancePx);
  const V one = Const(1.0f), zero = Const(0.0f);
  double num_neighbours = 0.0;
  for (int i = 0; i < n; ++i) {
    V Ai[8];
    for (int k = 0; k < 8; ++k) Ai[k] = Const(A[k * stride + i]);
    V votes_of_i = zero;
    for (int j = i + 1; j < n && x1[j] - x1[i] < radius1_px; j += kLanes) {
      const V2 d1 = {LoadU(x1 + j) - Const(x1[i]), LoadU(y1 + j) - Const(y1[i])};
      const V2 d2 = {LoadU(x2 + j) - Const(x2[i]), LoadU(y2 + j) - Const(y2[i])};
      const V s1 = SquaredNorm(d1), s2 = SquaredNorm(d2);
      const auto is_near = hn::And(hn::And(s1 < squared_radius1, s2 < squared_radius2),
                                   hn::And(s1 > squared_min, s2 > squared_min));
      const size_t num_near = hn::CountTrue(kTag, is_near);
      if (num_near == 0) continue;
      num_neighbours += static_cast<double>(num_near);
      const V tolerance1 = relative * s1 + absolute, tolerance2 = relative * s2 + absolute;
      V Aj[8];
      for (int k = 0; k < 8; ++k) Aj[k] = LoadU(A + k * stride + j);
      const auto i_predicts =
          hn::And(SquaredMiss(Ai, d1, d2) < tolerance2, SquaredMiss(Ai + 4, d2, d1) < tolerance1);
      // With the signs of both differences turned, the miss is the same.
      const auto j_predicts =
          hn::And(SquaredMiss(Aj, d1, d2) < tolerance2, SquaredMiss(Aj + 4, d2, d1) < tolerance1);
      const V votes = hn::IfThenElse(hn::And(is_near, i_predicts), one, zero) +
                      hn::IfThenElse(hn::And(is_near, j_predicts), one, zero);
      votes_of_i = votes_of_i + votes;
      hn::StoreU(LoadU(counts + j) + votes, kTag, counts + j);
    }
    // Small whole numbers: exact in any order.
    HWY_ALIGN float lanes[16];
    hn::Store(votes_of_i, kTag, lanes);
    for (int k = 0; k < kLanes; ++k) counts[i] += lanes[k];
  }
  return num_neighbours;
}

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace cairn {
HWY_EXPORT(CountConsensusKernel);
namespace internal {
double CountConsensus(const ConsensusColumns& columns, float radius1_px, float radius2_px,
                      float* counts) {
  return HWY_DYNAMIC_DISPATCH(CountConsensusKernel)(columns, radius1_px, radius2_px, counts);
}

double ConsensusChance(double squared_radius_px) {
  // The mean of the tolerance's area over a uniform neighbourhood.
  return std::min(1.0, 0.5 * kRelativeTolerance * kRelativeTolerance +
                           kTolerancePx * kTolerancePx / squared_radius_px);
}
}  // namespace internal
}  // namespace cairn
#endif
