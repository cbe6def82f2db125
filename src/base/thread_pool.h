#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace cairn {

// Threads that help with the loops of others. The thread that starts a loop works on it, too, and
// waits only for helpers that have begun: a loop ends without those that another program, another
// loop or their own start keeps away. (OpenMP's threads all have to come before a region ends, and
// turn idly for milliseconds after it: measured in tests/bench/README.md, "Threads of loops".)
class ThreadPool {
 public:
  // The one of this process. It has no end: threads wait in it until the process has one.
  static ThreadPool& Get();

  // Starts helpers until there are so many, or as many as the system lets start. Returns how many
  // there are.
  int Grow(int num_helpers);

  // Runs body(0) on the calling thread, and body(1), ... body(num_workers - 1) on helpers that are
  // free before body(0) returns. Returns when all that have begun have ended. body throws nothing.
  void Run(int num_workers, const std::function<void(int)>& body);

 private:
  struct Loop {
    const std::function<void(int)>& body;
    const int num_workers;
    int next_worker = 1;
    std::atomic<int> num_running = 0;  // helpers
  };

  void Help();

  std::mutex mutex_;
  std::condition_variable opened_, ended_;
  std::deque<Loop*> open_;  // loops that want more helpers
  std::atomic<int> num_open_ = 0;
  std::vector<std::thread> helpers_;
  bool is_full_ = false;  // the system lets no more start
};

}  // namespace cairn
