#include "run.h"

#include <atomic>
#include <chrono>
#include <exception>
#include <future>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "arrays.h"
#include "common/run_flags.h"

namespace cairn::python {
namespace {

// How often Python is asked for signals: far less than a person notices.
constexpr std::chrono::milliseconds kPollInterval(50);

// Of all threads; guarded by the interpreter's lock.
struct LongCalls {
  int num_running = 0;
  bool must_stop = false;  // the interpreter ends
};
LongCalls& Calls() {
  static LongCalls calls;
  return calls;
}

void StopCalls() {
  Calls().must_stop = true;
  while (Calls().num_running > 0) {
    const py::gil_scoped_release release;
    std::this_thread::sleep_for(kPollInterval);
  }
}

// Gathers on any thread what Python is told on its own.
class Mailbox : public ProgressMonitor {
 public:
  void BeginStage(const std::string& name, int64_t total) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    stage_ = {name, 0, total};
    stages_.push_back(stage_);
  }
  void Advance(int64_t num_done) override {
    const std::lock_guard<std::mutex> lock(mutex_);
    stage_.done += num_done;
    // The beginning of a stage is told, and then the newest state alone.
    const bool is_newest = !stages_.empty() && stages_.back().done > 0;
    if (is_newest) stages_.back() = stage_;
    if (!is_newest) stages_.push_back(stage_);
  }
  void Info(const std::string& message) override { Add("info", message); }
  void Warning(const std::string& message) override { Add("warning", message); }
  bool StopRequested() const override { return stop_; }

  void Stop() { stop_ = true; }
  // With the interpreter's lock; Python may raise.
  void Deliver(const py::object& progress) {
    std::vector<Stage> stages;
    std::vector<std::pair<const char*, std::string>> messages;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      stages.swap(stages_);
      messages.swap(messages_);
    }
    for (const auto& [level, text] : messages) {
      py::module_::import("logging").attr("getLogger")("cairn").attr(level)("%s", ToText(text));
    }
    if (progress.is_none()) return;
    for (const Stage& stage : stages) progress(stage.name, stage.done, stage.total);
  }

 private:
  struct Stage {
    std::string name;
    int64_t done = 0, total = 0;
  };
  void Add(const char* level, const std::string& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    messages_.emplace_back(level, message);
  }

  std::atomic<bool> stop_ = false;
  std::mutex mutex_;
  Stage stage_;  // the present one
  std::vector<Stage> stages_;
  std::vector<std::pair<const char*, std::string>> messages_;
};

}  // namespace

void CheckNumThreads(int num_threads) { ValidateOptions(ThreadFlags{num_threads}, ""); }

LongCall::LongCall() {
  if (Calls().must_stop) throw std::runtime_error("the interpreter is ending");
  ++Calls().num_running;
}

LongCall::~LongCall() { --Calls().num_running; }

UnlockedUnlessEnding::UnlockedUnlessEnding() {
  if (!Calls().must_stop) unlocked_.emplace();
}

void StopCallsAtExit() {
  py::module_::import("atexit").attr("register")(py::cpp_function(&StopCalls));
  // A fork has none of the other threads.
  py::module_::import("os").attr("register_at_fork")(
      py::arg("after_in_child") = py::cpp_function([] { Calls().num_running = 0; }));
}

void RunInterruptibly(const RunArguments& arguments,
                      const std::function<void(const RunContext& context)>& work) {
  CheckNumThreads(arguments.num_threads);
  const LongCall call;
  Mailbox mailbox;
  const RunContext context{arguments.seed, arguments.num_threads, mailbox};
  std::future<void> result = std::async(std::launch::async, [&] { work(context); });
  std::exception_ptr raised;
  for (bool is_done = false; !is_done;) {
    {
      const py::gil_scoped_release release;
      is_done = result.wait_for(kPollInterval) == std::future_status::ready;
    }
    if (Calls().must_stop) mailbox.Stop();
    try {
      if (!raised) mailbox.Deliver(arguments.progress);
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    } catch (...) {
      if (!raised) raised = std::current_exception();
      mailbox.Stop();
    }
  }
  if (raised) std::rethrow_exception(raised);
  result.get();
}

}  // namespace cairn::python
