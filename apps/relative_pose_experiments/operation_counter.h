#pragma once

#include <cstdint>
#include <functional>

namespace cairn::experiments {

// What a piece of code costs, counted on the processor.
struct OperationCount {
  int64_t instructions = 0;
  // Floating-point operations; one that works on two numbers at once counts as two.
  int64_t additions = 0;  // and subtractions
  int64_t multiplications = 0;
  int64_t divisions = 0;
  int64_t square_roots = 0;

  int64_t Arithmetic() const { return additions + multiplications + divisions + square_roots; }
  OperationCount& operator+=(const OperationCount& other);
};

// Whether this build can count: x86-64, without a sanitizer.
bool CanCountOperations();

// Runs fn with the processor's trap flag set, so that it stops after every instruction, and looks
// at each next instruction (SSE; no newer set is used meanwhile). About a microsecond an
// instruction. Not reentrant, one thread at a time. fn must not throw. All zeros where it cannot
// count.
OperationCount CountOperations(const std::function<void()>& fn);

}  // namespace cairn::experiments
