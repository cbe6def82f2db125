#pragma once

#include "cairn/base/options.h"
#include "cairn/base/run_context.h"

namespace cairn {

// The flags of a program's RunContext, where nothing is random.
struct ThreadFlags {
  int num_threads = 0;

  void VisitFields(OptionVisitor& v) {
    v.Int("num_threads", num_threads, {0, 1024}, "threads; 0: all");
  }
  RunContext Run(ProgressMonitor& monitor) const {
    return {.num_threads = num_threads, .monitor = monitor};
  }
};

// The same and the seed.
struct RunFlags : ThreadFlags {
  int seed = 0;

  void VisitFields(OptionVisitor& v) {
    ThreadFlags::VisitFields(v);
    v.Int("seed", seed, {0, 2147483647}, "seed of all random numbers");
  }
  RunContext Run(ProgressMonitor& monitor) const {
    return {static_cast<uint64_t>(seed), num_threads, monitor};
  }
};

}  // namespace cairn
