#pragma once

#include <pybind11/pybind11.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <type_traits>

#include "cairn/base/run_context.h"

namespace cairn::python {

namespace py = pybind11;

// What every long call is told about its run.
struct RunArguments {
  uint64_t seed = 0;
  int num_threads = 0;
  py::object progress;  // None, or called as progress(stage, num_done, num_total)
};

// Throws ConfigError unless the programs take so many threads.
void CheckNumThreads(int num_threads);

// A call that leaves the interpreter's lock for a while. The end of the interpreter waits for it,
// since a thread that takes the lock after that is ended amid its work. Made and destroyed with the
// lock; raises RuntimeError where the end has begun.
class LongCall {
 public:
  LongCall();
  ~LongCall();
  LongCall(const LongCall&) = delete;
};

// A block without the interpreter's lock.
class Unlocked {
  const LongCall call_;
  const py::gil_scoped_release release_;
};

// The same of what may wait for another thread, but not for long: it keeps the lock where the end
// of the interpreter has begun.
class UnlockedUnlessEnding {
 public:
  UnlockedUnlessEnding();

 private:
  std::optional<Unlocked> unlocked_;
};

// Makes the end of the interpreter stop long calls and wait for them.
void StopCallsAtExit();

// Runs work(context) on a thread of its own, without the interpreter's lock. The calling thread
// delivers progress, passes messages on to logging.getLogger("cairn"), and lets Python handle
// signals. Where one of these raises (KeyboardInterrupt), the work is told to stop, and the
// exception goes on once it has.
void RunInterruptibly(const RunArguments& arguments,
                      const std::function<void(const RunContext& context)>& work);

// The same of work with a result.
template <class Work>
auto ResultOf(const RunArguments& arguments, const Work& work) {
  std::invoke_result_t<Work, const RunContext&> result;
  RunInterruptibly(arguments, [&](const RunContext& context) { result = work(context); });
  return result;
}

// The same of work that is one step: progress is told its beginning and its end.
template <class Work>
auto ResultOfStep(const std::string& name, const RunArguments& arguments, const Work& work) {
  return ResultOf(arguments, [&](const RunContext& context) {
    context.monitor.BeginStage(name, 1);
    auto result = work(context);
    context.monitor.Advance(1);
    context.monitor.EndStage();
    return result;
  });
}

}  // namespace cairn::python
