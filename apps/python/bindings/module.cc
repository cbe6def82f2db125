#include <filesystem>

#include "bindings.h"
#include "cairn/base/error.h"
#include "run.h"

namespace cairn::python {

void BindErrors(py::module_& m) {
  // Python's own kinds, so that `except OSError` takes a file that is absent, too.
  py::register_exception<IoError>(m, "IoError", PyExc_OSError).doc() =
      "A file, folder or database that cannot be read or written: '<path>: <reason>'.";
  py::register_exception<ConfigError>(m, "ConfigError", PyExc_ValueError).doc() =
      "A wrong argument or option: '<name>: <reason>'.";
  py::register_exception<BugError>(m, "BugError", PyExc_RuntimeError).doc() =
      "A broken precondition: a defect in cairn.";
  // A path that cannot be looked at; what a translator throws goes to those before it.
  py::register_exception_translator([](std::exception_ptr exception) {
    try {
      std::rethrow_exception(exception);
    } catch (const std::filesystem::filesystem_error& error) {
      throw IoError(error.path1().string(), error.code().message());
    }
  });
}

}  // namespace cairn::python

PYBIND11_MODULE(_cairn, m) {
  using namespace cairn::python;
  py::options options;
  options.disable_enum_members_docstring();
  m.attr("__version__") = CAIRN_VERSION;
  BindErrors(m);
  BindOptions(m);
  BindGeometry(m);
  BindReconstruction(m);
  BindPairs(m);
  BindDatabase(m);
  BindAveraging(m);
  BindAdjustment(m);
  BindViewGraph(m);
  BindPipeline(m);
  StopCallsAtExit();
}
