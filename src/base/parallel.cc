#include "cairn/base/parallel.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace cairn {
namespace {

// Runs body(worker) on num_workers threads: OpenMP, or std::thread under the thread sanitizer,
// which cannot see into the OpenMP runtime.
template <class Body>
void RunWorkers(int num_workers, const Body& body) {
#if defined(__SANITIZE_THREAD__)
  std::vector<std::thread> threads;
  for (int w = 1; w < num_workers; ++w) threads.emplace_back([&body, w] { body(w); });
  body(0);
  for (std::thread& thread : threads) thread.join();
#else
#pragma omp parallel num_threads(num_workers)
  body(omp_get_thread_num());
#endif
}

}  // namespace

int EffectiveNumThreads(int num_threads) {
  if (num_threads > 0) return num_threads;
  return std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
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
  RunWorkers(num_workers, [&](int worker) {
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
