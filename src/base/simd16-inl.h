// Sixteen float lanes on any target: included once for each instruction set (no include guard in
// the ordinary sense; see Highway's quick reference, "foreach_target").
#if defined(CAIRN_BASE_SIMD16_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef CAIRN_BASE_SIMD16_INL_H_
#undef CAIRN_BASE_SIMD16_INL_H_
#else
#define CAIRN_BASE_SIMD16_INL_H_
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// The native vector of at most 16 floats.
using Tag = hn::CappedTag<float, 16>;
using V = hn::Vec<Tag>;
inline constexpr Tag kTag;
inline constexpr int kLanes = static_cast<int>(hn::MaxLanes(Tag()));
inline constexpr int kParts = 16 / kLanes;

HWY_INLINE V Const(float value) { return hn::Set(kTag, value); }
HWY_INLINE V Load(const float* p) { return hn::Load(kTag, p); }
HWY_INLINE V LoadU(const float* p) { return hn::LoadU(kTag, p); }  // of any alignment

// Sum of 16 lanes kept in kParts vectors, by halving: lane i with lane i + 8, then + 4, 2, 1. The
// order is the same whatever the width of a vector.
HWY_INLINE float SumLanes(const V* parts) {
  HWY_ALIGN float lanes[16];
  for (int k = 0; k < kParts; ++k) hn::Store(parts[k], kTag, lanes + k * kLanes);
  const hn::CappedTag<float, 4> four;
  constexpr int kStep = static_cast<int>(hn::MaxLanes(four));  // less without vectors
  for (int i = 0; i < 4; i += kStep) {
    const auto low = hn::Load(four, lanes + i) + hn::Load(four, lanes + i + 8);
    const auto high = hn::Load(four, lanes + i + 4) + hn::Load(four, lanes + i + 12);
    hn::Store(low + high, four, lanes + i);
  }
  return (lanes[0] + lanes[2]) + (lanes[1] + lanes[3]);
}

// 1 for the lanes of [first, first + kLanes) below n, else 0.
HWY_INLINE V LaneMask(int first, int n) {
  const int count = n < first ? 0 : n - first < kLanes ? n - first : kLanes;
  return hn::IfThenElseZero(hn::FirstN(kTag, static_cast<size_t>(count)), Const(1.0f));
}

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
