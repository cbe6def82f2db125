#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <cmath>
#include <map>

#include "arrays.h"
#include "bindings.h"
#include "cairn/base/error.h"
#include "cairn/bundle_adjustment/bundle_adjustment.h"
#include "cairn/bundle_adjustment/pose_confidence.h"
#include "options.h"
#include "run.h"

namespace cairn::python {
namespace {

using Priors = std::map<camera_t, IntrinsicsPrior>;

IntrinsicsPrior MakePrior(std::vector<double> params, double focal_sigma,
                          double principal_point_sigma_px) {
  CheckPositive("focal_sigma", focal_sigma);
  if (!(principal_point_sigma_px >= 0) || !std::isfinite(principal_point_sigma_px)) {
    throw ConfigError("principal_point_sigma_px", "is negative or not finite");
  }
  return {std::move(params), focal_sigma, principal_point_sigma_px};
}

// Throws ConfigError unless the cameras are there and may have these parameters.
void CheckPriors(const Priors& priors, const std::map<camera_t, Camera>& cameras) {
  for (const auto& [id, prior] : priors) {
    CheckIsThere("priors", "camera", id, cameras);
    Camera camera = cameras.at(id);
    camera.params = prior.params;
    const std::string reason = camera.Validate();
    if (!reason.empty()) throw ConfigError("priors[" + std::to_string(id) + "]", reason);
  }
}

BundleAdjustmentReport Adjust(Reconstruction& reconstruction, bool rotations, bool positions,
                              bool points, bool focal_lengths, bool distortions,
                              bool principal_points, const py::iterable& fixed_cameras,
                              const py::iterable& fixed_images, const py::object& given_priors,
                              const py::object& options, int num_threads,
                              const py::object& progress) {
  BundleAdjustmentScope scope;
  scope.rotations = rotations;
  scope.positions = positions;
  scope.points = points;
  scope.focal_lengths = focal_lengths;
  scope.distortions = distortions;
  scope.principal_points = principal_points;
  scope.fixed_cameras = ToIds("fixed_cameras", "camera", fixed_cameras, reconstruction.cameras);
  scope.fixed_images = ToIds("fixed_images", "image", fixed_images, reconstruction.images);
  try {
    scope.priors = py::dict(given_priors).cast<Priors>();
  } catch (const py::cast_error&) {
    throw ConfigError("priors", "not all are an IntrinsicsPrior by camera id");
  }
  CheckPriors(scope.priors, reconstruction.cameras);
  const auto settings = ToOptions<BundleAdjustmentOptions>(options);
  return ResultOfStep("adjust_bundle", {0, num_threads, progress}, [&](const RunContext& run) {
    const BundleAdjustmentReport report = AdjustBundle(reconstruction, scope, settings, run);
    if (report.status != BundleAdjustmentStatus::kFailed) reconstruction.UpdatePointErrors();
    return report;
  });
}

void BindReports(py::module_& m) {
  using Report = BundleAdjustmentReport;
  py::class_<Report>(m, "BundleAdjustmentReport", "The result of adjust_bundle.")
      .def_property_readonly("status", EnumName(&Report::status, BundleAdjustmentStatusName))
      .def_readonly("fault", &Report::fault,
                    "Of a failure: the first value that cannot be adjusted.")
      .def_readonly("num_images", &Report::num_images)
      .def_readonly("num_points", &Report::num_points)
      .def_readonly("num_observations", &Report::num_observations)
      .def_readonly("num_iterations", &Report::num_iterations)
      .def_readonly("initial_rmse", &Report::initial_rmse, "Standard deviations of keypoints.")
      .def_readonly("final_rmse", &Report::final_rmse, "Standard deviations of keypoints.")
      .def_readonly("seconds", &Report::seconds);
  py::class_<PoseConfidence>(m, "PoseConfidence", "How well its points determine a pose.")
      .def_readonly("num_points", &PoseConfidence::num_points)
      .def_readonly("rotation_sigma_deg", &PoseConfidence::rotation_sigma_deg)
      .def_readonly("position_sigma", &PoseConfidence::position_sigma, "World units.");
}

}  // namespace

void BindAdjustment(py::module_& m) {
  py::class_<IntrinsicsPrior>(m, "IntrinsicsPrior", "What is known of a camera beforehand.")
      .def(py::init(&MakePrior), py::arg("params"), py::arg("focal_sigma"),
           py::arg("principal_point_sigma_px"),
           "Expected params; standard deviations of the focal length's logarithm and, in pixels, "
           "of the principal point (0: it is constant).");
  BindReports(m);
  m.def("adjust_bundle", &Adjust, py::arg("reconstruction"), py::kw_only(),
        py::arg("rotations") = true, py::arg("positions") = true, py::arg("points") = true,
        py::arg("focal_lengths") = false, py::arg("distortions") = false,
        py::arg("principal_points") = false, py::arg("fixed_cameras") = py::set(),
        py::arg("fixed_images") = py::set(), py::arg("priors") = py::dict(),
        py::arg("options") = py::none(), py::arg("num_threads") = 0,
        py::arg("progress") = py::none(),
        "Minimizes the robust reprojection error over what is named. Changes the reconstruction in "
        "place; no other thread may use it meanwhile. Principal points are adjusted of cameras "
        "with a prior. Keypoints of reconstruct's models have standard deviations by their size; "
        "a model from files has none, and 1 px is assumed.");
  m.def(
      "estimate_pose_confidence",
      [](const Reconstruction& r, int num_threads) {
        CheckNumThreads(num_threads);
        const Unlocked unlocked;
        return EstimatePoseConfidence(r, {.num_threads = num_threads});
      },
      py::arg("reconstruction"), py::kw_only(), py::arg("num_threads") = 0,
      "PoseConfidence by image id. See adjust_bundle on models from files.");
}

}  // namespace cairn::python
