#pragma once

#include <cstdint>
#include <functional>

namespace cairn {

// The number of threads to use for an option value: itself if positive, else all hardware threads.
int EffectiveNumThreads(int num_threads);

// Calls fn(i) once for every i in [0, n), on up to num_threads threads (<= 0: all), with dynamic
// scheduling in blocks of `grain` indices. The first exception stops the loop (blocks already begun
// are finished) and is thrown again in the caller. fn must write only what belongs to i: then the
// result does not depend on the number of threads. This is the only place with threads in loops.
// Loops within loops are welcome: threads without work help with any that is open.
void ParallelFor(int num_threads, int64_t n, const std::function<void(int64_t)>& fn,
                 int64_t grain = 1);

// The same, telling fn which worker runs it (0 .. num_threads-1): for scratch memory, never for
// results.
void ParallelForWorker(int num_threads, int64_t n,
                       const std::function<void(int worker, int64_t i)>& fn, int64_t grain = 1);

// Within its scope, OpenMP regions that libraries open (CHOLMOD: four threads for loops of
// microseconds) run on the calling thread alone.
class SerialOpenMpScope {
 public:
  SerialOpenMpScope();
  ~SerialOpenMpScope();
  SerialOpenMpScope(const SerialOpenMpScope&) = delete;
  SerialOpenMpScope& operator=(const SerialOpenMpScope&) = delete;

 private:
  int max_active_levels_;
};

}  // namespace cairn
