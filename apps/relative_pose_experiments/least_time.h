#pragma once

#include <algorithm>
#include <limits>

#include "cairn/base/timer.h"

namespace cairn::experiments {

// The time of a call without what else the machine does: the least of three, seconds.
template <class Fn>
double LeastSeconds(const Fn& fn) {
  double least = std::numeric_limits<double>::infinity();
  for (int run = 0; run < 3; ++run) {
    const Timer timer;
    fn();
    least = std::min(least, timer.Seconds());
  }
  return least;
}

}  // namespace cairn::experiments
