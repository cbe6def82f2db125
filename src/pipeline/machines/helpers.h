#pragma once

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "cairn/base/parallel.h"
#include "cairn/base/peers.h"
#include "cairn/base/run_context.h"
#include "pipeline/machines/batch.h"

namespace cairn {

// The other ranks of a job as rank 0 sees them: they compute features, matches and verified pairs
// from what it sends them (HelpToBuild is their side). Rank 0 alone has the database, and its
// threads compute too.
class Helpers {
 public:
  // Tells them the setup. A helper keeps at most max_image_bytes of images for pairs to come.
  // Throws ConfigError naming a helper that runs another build.
  Helpers(Peers& peers, HelperSetup setup, int64_t max_image_bytes, const RunContext& run);

  // Ranks on this machine, this process included: they share its memory.
  int NumOnThisMachine() const { return num_on_host_.at(own_hello_.host); }

 private:
  friend class HelperLoop;

  struct Helper {
    std::string host;
    std::string name;  // "rank 2 on node7"
    int num_threads = 1;
    HeldImages images;
    int64_t num_waiting = 0;  // tasks whose results have not come yet
  };

  void ReceiveHello(const Peers::Message& message, int num_threads);

  Peers& peers_;
  const int64_t max_unsent_bytes_;
  std::vector<Helper> helpers_;  // rank 1 first
  const HelperHello own_hello_ = HelperHello::OfThisProcess();
  std::map<std::string, int> num_on_host_ = {{own_hello_.host, 1}};  // ranks
  std::string wrong_build_;                                          // its name
};

// A stage's tasks, as HelperLoop takes them. All run in its thread.
struct HelperWork {
  TaskKind kind = TaskKind::kExtract;
  std::function<int64_t()> num_left;               // tasks that are left, about
  std::function<bool(TaskBatch& batch)> add_next;  // false: none is left
  std::function<void(ByteSource& result, const std::string& helper)> accept;
  std::function<void()> stop;  // the loop has failed: the threads of this process are to stop
};

// Has helpers compute tasks of a stage while the threads of this process take others. The stage's
// results are the same: a task's result depends on the task alone.
class HelperLoop {
 public:
  // Begins, in a thread of its own. helpers == nullptr: there are none, and nothing to do.
  HelperLoop(Helpers* helpers, HelperWork work, const RunContext& run);
  // Drops what is on its way.
  ~HelperLoop();

  // Returns when the results of all tasks that helpers got are accepted, or the monitor wants to
  // stop. Throws what `work` threw, and IoError that names a helper that failed.
  void Finish();

 private:
  void Run();
  bool ReceiveResults();  // false: nothing has arrived
  void SendTasks(int rank);
  int64_t BatchSize(const Helpers::Helper& helper) const;

  Helpers* const helpers_;
  const HelperWork work_;
  const RunContext& run_;
  int num_threads_ = 0;  // of all ranks
  bool has_more_ = true;
  std::atomic<bool> is_dropped_ = false;
  std::exception_ptr error_;
  std::thread thread_;
};

// Computes all tasks, of one kind, of a queue (PairFeed, WorkQueue), in the threads of this process
// by compute(worker, task) or by helpers, and gives each result to keep(result, helper), in any
// thread; helper is "" for this process. Returns early, with what is done, when the monitor wants
// to stop.
template <class Result, class Queue, class Compute, class Keep>
void ForEachTask(TaskKind kind, Queue& queue, Helpers* helpers, const RunContext& run,
                 const Compute& compute, const Keep& keep) {
  HelperWork work;
  work.kind = kind;
  work.num_left = [&queue] { return queue.NumLeft(); };
  work.add_next = [&queue](TaskBatch& batch) {
    const auto task = queue.Next();
    if (task) batch.Add(*task);
    return task.has_value();
  };
  work.accept = [&keep](ByteSource& result, const std::string& helper) {
    keep(result.Get<Result>(), helper);
  };
  work.stop = [&queue] { queue.Stop(); };
  const int64_t num_tasks = queue.NumLeft();
  HelperLoop loop(helpers, std::move(work), run);
  ParallelForWorker(run.num_threads, num_tasks, [&](int worker, int64_t) {
    if (run.monitor.StopRequested()) queue.Stop();
    if (const auto task = queue.Next()) keep(compute(worker, *task), "");
  });
  loop.Finish();
}

}  // namespace cairn
