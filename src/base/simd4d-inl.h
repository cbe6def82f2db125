// Four double lanes on any target: included once for each instruction set, as simd16-inl.h is.
#if defined(CAIRN_BASE_SIMD4D_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef CAIRN_BASE_SIMD4D_INL_H_
#undef CAIRN_BASE_SIMD4D_INL_H_
#else
#define CAIRN_BASE_SIMD4D_INL_H_
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// The native vector of at most four doubles.
using Tag = hn::CappedTag<double, 4>;
using V = hn::Vec<Tag>;
inline constexpr Tag kTag;
inline constexpr int kLanes = static_cast<int>(hn::MaxLanes(Tag()));
inline constexpr int kParts = 4 / kLanes;

HWY_INLINE V Const(double value) { return hn::Set(kTag, value); }
HWY_INLINE V Load(const double* p) { return hn::LoadU(kTag, p); }
HWY_INLINE void Store(V value, double* p) { hn::StoreU(value, kTag, p); }

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif
