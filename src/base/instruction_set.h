#pragma once

namespace cairn {

// While an object of this class exists, code that chooses its instruction set at run time uses that
// of the build (SSE2 on x86-64), for tools that know no newer one. One at a time, while no other
// thread computes.
class BuildsInstructionSet {
 public:
  BuildsInstructionSet();
  ~BuildsInstructionSet();
  BuildsInstructionSet(const BuildsInstructionSet&) = delete;
  BuildsInstructionSet& operator=(const BuildsInstructionSet&) = delete;
};

}  // namespace cairn
