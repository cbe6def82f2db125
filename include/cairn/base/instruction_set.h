#pragma once

namespace cairn {

// While it lives, code that chooses its instruction set at run time uses that of the build itself
// (SSE2 on x86-64), for what knows no newer one. One at a time, while no other thread computes.
class BuildsInstructionSet {
 public:
  BuildsInstructionSet();
  ~BuildsInstructionSet();
  BuildsInstructionSet(const BuildsInstructionSet&) = delete;
  BuildsInstructionSet& operator=(const BuildsInstructionSet&) = delete;
};

}  // namespace cairn
