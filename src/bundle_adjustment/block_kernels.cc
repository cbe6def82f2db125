#include "bundle_adjustment/block_kernels.h"

#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "bundle_adjustment/block_kernels.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "base/simd4d-inl.h"

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

HWY_INLINE V LoadAsDouble(const float* p) {
  return hn::PromoteTo(kTag, hn::LoadU(hn::Rebind<float, Tag>(), p));
}

template <int kSize>
HWY_INLINE void SubtractProductOf(const float* J, const double* M, const float* L, double* block) {
  constexpr int kNumVectors = kSize / kLanes;
  V T[2][kNumVectors];  // M L
  for (int k = 0; k < kNumVectors; ++k) {
    const V upper = LoadAsDouble(L + k * kLanes), lower = LoadAsDouble(L + kSize + k * kLanes);
    for (int i = 0; i < 2; ++i) {
      T[i][k] = Const(M[2 * i]) * upper + Const(M[2 * i + 1]) * lower;
    }
  }
  for (int row = 0; row < kSize; ++row) {
    const V upper = Const(J[row]), lower = Const(J[kSize + row]);
    for (int k = 0; k < kNumVectors; ++k) {
      double* p = block + row * kSize + k * kLanes;
      Store(Load(p) - (upper * T[0][k] + lower * T[1][k]), p);
    }
  }
}

void SubtractProduct4(const float* J, const double* M, const float* L, double* block) {
  SubtractProductOf<4>(J, M, L, block);
}
void SubtractProduct12(const float* J, const double* M, const float* L, double* block) {
  SubtractProductOf<12>(J, M, L, block);
}
void SubtractProduct24(const float* J, const double* M, const float* L, double* block) {
  SubtractProductOf<24>(J, M, L, block);
}

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace cairn {

HWY_EXPORT(SubtractProduct4);
HWY_EXPORT(SubtractProduct12);
HWY_EXPORT(SubtractProduct24);

template <>
void SubtractProduct<4>(const float* J, const double* M, const float* L, double* block) {
  HWY_DYNAMIC_DISPATCH(SubtractProduct4)(J, M, L, block);
}
template <>
void SubtractProduct<12>(const float* J, const double* M, const float* L, double* block) {
  HWY_DYNAMIC_DISPATCH(SubtractProduct12)(J, M, L, block);
}
template <>
void SubtractProduct<24>(const float* J, const double* M, const float* L, double* block) {
  HWY_DYNAMIC_DISPATCH(SubtractProduct24)(J, M, L, block);
}

}  // namespace cairn
#endif
