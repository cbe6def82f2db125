#include "relative_pose_experiments/operation_counter.h"

#include "base/sanitized.h"

#if defined(__x86_64__) && defined(__linux__) && !CAIRN_SANITIZED
#define CAIRN_CAN_COUNT 1
#include <signal.h>
#include <ucontext.h>
#include <x86intrin.h>

#include "base/instruction_set.h"
#include "cairn/base/check.h"
#endif

namespace cairn::experiments {

OperationCount& OperationCount::operator+=(const OperationCount& other) {
  instructions += other.instructions;
  additions += other.additions;
  multiplications += other.multiplications;
  divisions += other.divisions;
  square_roots += other.square_roots;
  return *this;
}

#ifdef CAIRN_CAN_COUNT
namespace {

constexpr unsigned long long kTrapFlag = 0x100;

// The signal handler has no other way to reach its result.
OperationCount* current = nullptr;

// Intel 64 manual, volume 2, chapter 2: prefixes, then 0F and the opcode of the SSE operations.
void CountInstruction(const uint8_t* code, OperationCount* count) {
  ++count->instructions;
  int lanes = 4;  // no prefix: four floats
  for (;; ++code) {
    if (*code == 0x66) {
      lanes = 2;  // two doubles
    } else if (*code == 0xf2 || *code == 0xf3) {
      lanes = 1;
    } else if ((*code & 0xf0) != 0x40) {  // 40..4f: REX
      break;
    }
  }
  if (code[0] != 0x0f) return;
  switch (code[1]) {
    case 0x51:
      count->square_roots += lanes;
      break;
    case 0x58:
    case 0x5c:
      count->additions += lanes;
      break;
    case 0x59:
      count->multiplications += lanes;
      break;
    case 0x5e:
      count->divisions += lanes;
      break;
    default:
      break;
  }
}

void OnTrap(int, siginfo_t*, void* context) {
  const auto* registers = static_cast<ucontext_t*>(context)->uc_mcontext.gregs;
  CountInstruction(reinterpret_cast<const uint8_t*>(registers[REG_RIP]), current);
}

}  // namespace

bool CanCountOperations() { return true; }

OperationCount CountOperations(const std::function<void()>& fn) {
  OperationCount count;
  current = &count;
  struct sigaction action = {}, previous = {};
  action.sa_sigaction = OnTrap;
  action.sa_flags = SA_SIGINFO;
  CAIRN_CHECK_EQ(sigaction(SIGTRAP, &action, &previous), 0);
  const BuildsInstructionSet no_newer_one;
  __writeeflags(__readeflags() | kTrapFlag);
  fn();
  __writeeflags(__readeflags() & ~kTrapFlag);
  CAIRN_CHECK_EQ(sigaction(SIGTRAP, &previous, nullptr), 0);
  current = nullptr;
  return count;
}

#else

bool CanCountOperations() { return false; }

OperationCount CountOperations(const std::function<void()>& fn) {
  fn();
  return {};
}

#endif

}  // namespace cairn::experiments
