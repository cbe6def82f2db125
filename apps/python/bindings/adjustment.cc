#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "arrays.h"
#include "bindings.h"
#include "cairn/base/error.h"
#include "cairn/bundle_adjustment/bundle_adjustment.h"
#include "cairn/bundle_adjustment/pose_confidence.h"
#include "options.h"
#include "run.h"

namespace cairn::python {
namespace {

BundleAdjustmentReport Adjust(Reconstruction& reconstruction, bool rotations, bool positions,
                              bool points, bool focal_lengths, bool distortions,
                              bool principal_points, const std::set<camera_t>& fixed_cameras,
                              const std::set<image_t>& fixed_images,
                              const std::map<camera_t, IntrinsicsPrior>& priors,
                              const py::object& options, int num_threads,
                              const py::object& progress) {
  BundleAdjustmentScope scope;
  scope.rotations = rotations;
  scope.positions = positions;
  scope.points = points;
  scope.focal_lengths = focal_lengths;
  scope.distortions = distortions;
  scope.principal_points = principal_points;
  scope.fixed_cameras = fixed_cameras;
  scope.fixed_images = fixed_images;
  scope.priors = priors;
  const auto settings = ToOptions<BundleAdjustmentOptions>(options);
  return ResultOf({0, num_threads, progress}, [&](const RunContext& run) {
    const BundleAdjustmentReport report = AdjustBundle(reconstruction, scope, settings, run);
    if (report.status != BundleAdjustmentStatus::kFailed) reconstruction.UpdatePointErrors();
    return report;
  });
}

void BindReports(py::module_& m) {
  using Report = BundleAdjustmentReport;
  py::class_<Report>(m, "BundleAdjustmentReport", "The result of adjust_bundle.")
      .def_property_readonly("status", EnumName(&Report::status, BundleAdjustmentStatusName))
      .def_readonly("num_images", &Report::num_images)
      .def_readonly("num_points", &Report::num_points)
      .def_readonly("num_observations", &Report::num_observations)
      .def_readonly("num_iterations", &Report::num_iterations)
      .def_readonly("initial_rmse", &Report::initial_rmse, "Standard deviations.")
      .def_readonly("final_rmse", &Report::final_rmse, "Standard deviations.")
      .def_readonly("seconds", &Report::seconds);
  py::class_<PoseConfidence>(m, "PoseConfidence", "How well its points determine a pose.")
      .def_readonly("num_points", &PoseConfidence::num_points)
      .def_readonly("rotation_sigma_deg", &PoseConfidence::rotation_sigma_deg)
      .def_readonly("position_sigma", &PoseConfidence::position_sigma, "World units.");
}

}  // namespace

void BindAdjustment(py::module_& m) {
  py::class_<IntrinsicsPrior>(m, "IntrinsicsPrior", "What is known of a camera beforehand.")
      .def(py::init<std::vector<double>, double, double>(), py::arg("params"),
           py::arg("focal_sigma"), py::arg("principal_point_sigma_px"));
  BindReports(m);
  m.def("adjust_bundle", &Adjust, py::arg("reconstruction"), py::kw_only(),
        py::arg("rotations") = true, py::arg("positions") = true, py::arg("points") = true,
        py::arg("focal_lengths") = false, py::arg("distortions") = false,
        py::arg("principal_points") = false, py::arg("fixed_cameras") = std::set<camera_t>(),
        py::arg("fixed_images") = std::set<image_t>(),
        py::arg("priors") = std::map<camera_t, IntrinsicsPrior>(), py::arg("options") = py::none(),
        py::arg("num_threads") = 0, py::arg("progress") = py::none(),
        "Minimizes the robust reprojection error over what is named. Changes the reconstruction in "
        "place; no other thread may use it meanwhile. Principal points are adjusted of cameras "
        "with a prior.");
  m.def(
      "estimate_pose_confidence",
      [](const Reconstruction& r) {
        const Unlocked unlocked;
        return EstimatePoseConfidence(r);
      },
      py::arg("reconstruction"), "PoseConfidence by image id.");
}

}  // namespace cairn::python
