#include "cairn/base/parallel.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>

#include "base/control_groups.h"
#include "base/thread_pool.h"

namespace cairn {

int EffectiveNumThreads(int num_threads) {
  static const int num_processors = NumProcessors();
  if (num_threads <= 0) num_threads = num_processors;
  num_threads = std::max(1, num_threads);
  return std::min(num_threads, ThreadPool::Get().Grow(num_threads - 1) + 1);
}

void ParallelForWorker(int num_threads, int64_t n, const std::function<void(int, int64_t)>& fn,
                       int64_t grain) {
  if (n <= 0) return;
  grain = std::max<int64_t>(1, grain);
  const int num_workers = static_cast<int>(
      std::min<int64_t>(EffectiveNumThreads(num_threads), (n + grain - 1) / grain));
  if (num_workers == 1) {
    for (int64_t i = 0; i < n; ++i) fn(0, i);
    return;
  }
  std::atomic<int64_t> next{0};
  std::atomic<bool> stop{false};
  std::exception_ptr error;
  std::mutex error_mutex;
  ThreadPool::Get().Run(num_workers, [&](int worker) {
    while (!stop.load(std::memory_order_relaxed)) {
      const int64_t begin = next.fetch_add(grain, std::memory_order_relaxed);
      if (begin >= n) return;
      try {
        for (int64_t i = begin; i < std::min(n, begin + grain); ++i) fn(worker, i);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(error_mutex);
        if (!error) error = std::current_exception();
        stop.store(true, std::memory_order_relaxed);
      }
    }
  });
  if (error) std::rethrow_exception(error);
}

// The number of nested active regions is a property of the calling thread.
SerialOpenMpScope::SerialOpenMpScope() : max_active_levels_(omp_get_max_active_levels()) {
  omp_set_max_active_levels(0);
}

SerialOpenMpScope::~SerialOpenMpScope() { omp_set_max_active_levels(max_active_levels_); }

void ParallelFor(int num_threads, int64_t n, const std::function<void(int64_t)>& fn,
                 int64_t grain) {
  ParallelForWorker(
      num_threads, n, [&fn](int, int64_t i) { fn(i); }, grain);
}

}  // namespace cairn
