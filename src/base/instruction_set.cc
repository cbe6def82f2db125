#include "base/instruction_set.h"

#include <hwy/targets.h>

#include <cstdint>

namespace cairn {
namespace {

// 0: all that the machine has.
void Restrict(int64_t targets) {
  hwy::SetSupportedTargetsForTest(targets);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

}  // namespace

BuildsInstructionSet::BuildsInstructionSet() { Restrict(HWY_STATIC_TARGET); }
BuildsInstructionSet::~BuildsInstructionSet() { Restrict(0); }

}  // namespace cairn
