#include <filesystem>

#include "arrays.h"
#include "bindings.h"
#include "cairn/base/error.h"
#include "run.h"

namespace cairn::python {

namespace {

// A kind of exception of the module, for ever.
PyObject* NewError(py::module_& m, const char* name, PyObject* base, const char* doc) {
  py::object type = py::reinterpret_steal<py::object>(
      PyErr_NewExceptionWithDoc(("cairn." + std::string(name)).c_str(), doc, base, nullptr));
  if (!type) throw py::error_already_set();
  m.add_object(name, type);
  return type.release().ptr();
}

void Raise(PyObject* type, const std::exception& error) {
  PyErr_SetObject(type, ToText(error.what()).ptr());
}

}  // namespace

void BindErrors(py::module_& m) {
  // Python's own kinds, so that `except OSError` takes a file that is absent, too.
  static PyObject* io =
      NewError(m, "IoError", PyExc_OSError,
               "A file, folder or database that cannot be read or written: '<path>: <reason>'.");
  static PyObject* config = NewError(m, "ConfigError", PyExc_ValueError,
                                     "A wrong argument or option: '<name>: <reason>'.");
  static PyObject* bug =
      NewError(m, "BugError", PyExc_RuntimeError, "A broken precondition: a defect in cairn.");
  py::register_exception_translator([](std::exception_ptr exception) {
    try {
      std::rethrow_exception(exception);
    } catch (const IoError& error) {
      Raise(io, error);
    } catch (const ConfigError& error) {
      Raise(config, error);
    } catch (const BugError& error) {
      Raise(bug, error);
    } catch (const std::filesystem::filesystem_error& error) {  // a path that cannot be looked at
      Raise(io, IoError(error.path1().string(), error.code().message()));
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
