#pragma once

#include <cstdint>

#include "cairn/base/progress.h"

namespace cairn {

// What every public call is told about its run, as one value and last, whatever it computes.
struct RunContext {
  uint64_t seed = 0;    // of all random numbers
  int num_threads = 0;  // 0: all. No result depends on it but Ceres' last digits (BundleSolver)
  ProgressMonitor& monitor = NullMonitor();
};

}  // namespace cairn
