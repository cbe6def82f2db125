#include "cairn/base/parallel.h"

#include <atomic>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <thread>
#include <vector>

#include "support/test.h"

namespace cairn {
namespace {

TEST(Parallel, EveryIndexOnceForAnyThreadsAndGrain) {
  for (const int threads : {1, 2, 8}) {
    for (const int64_t grain : {1, 7, 1000}) {
      for (const int64_t n : {0, 1, 5, 503}) {
        std::vector<std::atomic<int>> visits(n);
        ParallelFor(
            threads, n, [&](int64_t i) { ++visits[i]; }, grain);
        for (const auto& v : visits) EXPECT_EQ(v.load(), 1);
      }
    }
  }
  ParallelFor(2, -3, [](int64_t) { FAIL(); });
}

TEST(Parallel, SlotsDoNotDependOnTheNumberOfThreads) {
  const auto run = [](int threads) {
    std::vector<double> values(1000);
    ParallelFor(
        threads, 1000, [&](int64_t i) { values[i] = std::sin(i) * i; }, 3);
    return values;
  };
  EXPECT_EQ(run(1), run(2));
  EXPECT_EQ(run(1), run(8));
}

TEST(Parallel, WorkerIndicesAreInRange) {
  std::atomic<bool> in_range{true};
  ParallelForWorker(4, 1000, [&](int worker, int64_t) {
    if (worker < 0 || worker >= 4) in_range = false;
  });
  EXPECT_TRUE(in_range);
}

TEST(Parallel, FirstExceptionReachesTheCallerAndStopsTheLoop) {
  for (const int threads : {1, 2, 8}) {
    std::atomic<int64_t> num_run{0};
    const int64_t n = 20'000;  // Seconds, if it were not stopped: the thrower may have to wait.
    try {
      ParallelFor(threads, n, [&](int64_t i) {
        ++num_run;
        if (i == 10) throw std::runtime_error("index 10");
        if (i > 10) std::this_thread::sleep_for(std::chrono::milliseconds(1));
      });
      FAIL() << "no exception";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "index 10");
    }
    EXPECT_LT(num_run.load(), n);
  }
}

TEST(Parallel, NestedLoopsRunCompletely) {
  std::atomic<int> sum{0};
  ParallelFor(2, 10, [&](int64_t) { ParallelFor(4, 10, [&](int64_t) { ++sum; }); });
  EXPECT_EQ(sum.load(), 100);
}

TEST(Parallel, ALoopDoesNotWaitForThreadsThatOthersKeep) {
  std::atomic<bool> is_over{false};
  std::atomic<int> num_waiting{0};
  std::thread other([&] {
    ParallelFor(4, 4, [&](int64_t) {
      ++num_waiting;
      while (!is_over) std::this_thread::yield();
    });
  });
  while (num_waiting < 4) std::this_thread::yield();
  std::atomic<int> num_run{0};
  ParallelFor(4, 1000, [&](int64_t) { ++num_run; });
  EXPECT_EQ(num_run, 1000);
  is_over = true;
  other.join();
}

TEST(Parallel, ManyThreadsHaveLoopsAtOnce) {
  std::vector<std::thread> callers;
  std::atomic<int64_t> sum{0};
  for (int t = 0; t < 8; ++t) {
    callers.emplace_back([&] {
      for (int k = 0; k < 200; ++k) ParallelFor(4, 20, [&](int64_t i) { sum += i; });
    });
  }
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(sum, 8 * 200 * 190);
}

TEST(Parallel, EffectiveNumThreads) {
  EXPECT_EQ(EffectiveNumThreads(3), 3);
  EXPECT_GE(EffectiveNumThreads(0), 1);
  EXPECT_EQ(EffectiveNumThreads(-1), EffectiveNumThreads(0));
}

}  // namespace
}  // namespace cairn
