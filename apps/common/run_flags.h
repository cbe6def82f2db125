#pragma once

#include "cairn/base/options.h"
#include "cairn/base/run_context.h"

namespace cairn {

// The flags of a program's RunContext.
struct RunFlags {
  int num_threads = 0;
  int seed = 0;

  void VisitFields(OptionVisitor& v) {
    v.Int("num_threads", num_threads, {0, 1024}, "threads; 0: all");
    v.Int("seed", seed, {0, 2147483647}, "seed of all random numbers");
  }
  RunContext Run(ProgressMonitor& monitor) const {
    return {static_cast<uint64_t>(seed), num_threads, monitor};
  }
};

}  // namespace cairn
