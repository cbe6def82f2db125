#include "bundle_adjustment/schur_kernels.h"

#include "cairn/base/check.h"

// These would only cost compile time.
#define HWY_DISABLED_TARGETS (HWY_SSSE3 | HWY_AVX3_DL)
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "bundle_adjustment/schur_kernels.cc"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace cairn::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using internal::SchurPartner;

// The columns from `column` on that a vector holds.
template <int kBlock, class D>
HWY_INLINE void SubtractColumns(D d, int column, const double* J, const SchurPartner& partner) {
  const hn::Rebind<float, D> as_float;
  const auto C0 = hn::PromoteTo(d, hn::LoadU(as_float, partner.C + column));
  const auto C1 = hn::PromoteTo(d, hn::LoadU(as_float, partner.C + kBlock + column));
  const double* M = partner.M;
  const auto T0 = hn::Set(d, M[0]) * C0 + hn::Set(d, M[1]) * C1;
  const auto T1 = hn::Set(d, M[2]) * C0 + hn::Set(d, M[3]) * C1;
  double* block = partner.block + column;
  for (int row = 0; row < kBlock; ++row, block += kBlock) {
    const auto product = hn::Set(d, J[row]) * T0 + hn::Set(d, J[kBlock + row]) * T1;
    hn::StoreU(hn::LoadU(d, block) - product, d, block);
  }
}

// Whole vectors, then pairs.
template <int kBlock>
HWY_INLINE void SubtractAll(const double* J, const SchurPartner* partners, int num_partners) {
  const hn::CappedTag<double, 8> wide;
  const hn::CappedTag<double, 2> narrow;
  constexpr int kWide = static_cast<int>(hn::MaxLanes(wide));
  constexpr int kNarrow = static_cast<int>(hn::MaxLanes(narrow));
  for (const SchurPartner* partner = partners; partner != partners + num_partners; ++partner) {
    int column = 0;
    for (; column + kWide <= kBlock; column += kWide) {
      SubtractColumns<kBlock>(wide, column, J, *partner);
    }
    for (; column < kBlock; column += kNarrow) {
      SubtractColumns<kBlock>(narrow, column, J, *partner);
    }
  }
}

void Subtract(int block_size, const double* J, const SchurPartner* partners, int num_partners) {
  if (block_size == 10) return SubtractAll<10>(J, partners, num_partners);
  if (block_size == 14) return SubtractAll<14>(J, partners, num_partners);
  CAIRN_CHECK_EQ(block_size, 22);
  SubtractAll<22>(J, partners, num_partners);
}

}  // namespace cairn::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace cairn {

HWY_EXPORT(Subtract);

void internal::SubtractFromBlocks(int block_size, const double* J, const SchurPartner* partners,
                                  int num_partners) {
  HWY_DYNAMIC_DISPATCH(Subtract)(block_size, J, partners, num_partners);
}

}  // namespace cairn
#endif
