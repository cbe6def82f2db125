#include "cairn/base/parallel.h"

#include <omp.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <latch>
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

// How many of so many threads there can be at once. The OpenMP runtime ends the program where it
// cannot make a thread (too little memory, a limit of the system), so the first time that a number
// is asked for, it is tried.
int NumThreadsThatStart(int num_threads) {
  static std::mutex mutex;
  static int num_tried = 1, num_started = 1;
  const std::lock_guard<std::mutex> lock(mutex);
  if (num_threads > num_tried) {
    std::latch end(1);
    std::vector<std::thread> threads;
    try {
      while (static_cast<int>(threads.size()) + 1 < num_threads) {
        threads.emplace_back([&end] { end.wait(); });
      }
    } catch (const std::exception&) {  // std::system_error or std::bad_alloc: these are all
    }
    end.count_down();
    for (std::thread& thread : threads) thread.join();
    num_tried = num_threads;
    num_started = static_cast<int>(threads.size()) + 1;
  }
  return std::min(num_threads, num_started);
}

}  // namespace

int EffectiveNumThreads(int num_threads) {
  if (num_threads <= 0) num_threads = static_cast<int>(std::thread::hardware_concurrency());
  return NumThreadsThatStart(std::max(1, num_threads));
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
