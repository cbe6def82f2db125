#pragma once

#include <hwy/targets.h>

#include <cstdint>

namespace cairn::test {

// Calls check() once with each instruction set of this machine in use by the SIMD kernels.
template <class Check>
void ForEachInstructionSet(const Check& check) {
  for (int64_t remaining = hwy::SupportedTargets(); remaining != 0; remaining &= remaining - 1) {
    hwy::SetSupportedTargetsForTest(remaining & -remaining);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    check();
  }
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace cairn::test
