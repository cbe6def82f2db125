#pragma once

#include <pybind11/pybind11.h>

#include <cstdint>
#include <functional>
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

}  // namespace cairn::python
