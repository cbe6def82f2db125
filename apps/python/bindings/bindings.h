#pragma once

#include <pybind11/pybind11.h>

#include "cairn/scene/reconstruction.h"

// Maps of a reconstruction are changed in place, not copied to dictionaries.
PYBIND11_MAKE_OPAQUE(std::map<cairn::camera_t, cairn::Camera>)
PYBIND11_MAKE_OPAQUE(std::map<cairn::image_t, cairn::RegisteredImage>)
PYBIND11_MAKE_OPAQUE(std::map<cairn::point3D_t, cairn::Point3D>)

namespace cairn::python {

namespace py = pybind11;

// What the module `cairn` has, a source file a topic. In this order: signatures name the types of
// those before.
void BindErrors(py::module_& m);
void BindOptions(py::module_& m);
void BindGeometry(py::module_& m);
void BindReconstruction(py::module_& m);
void BindPairs(py::module_& m);
void BindDatabase(py::module_& m);
void BindAveraging(py::module_& m);
void BindAdjustment(py::module_& m);
void BindViewGraph(py::module_& m);
void BindPipeline(py::module_& m);

}  // namespace cairn::python
