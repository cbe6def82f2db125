#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "arrays.h"
#include "bindings.h"
#include "cairn/base/error.h"
#include "cairn/two_view/verify_pair.h"
#include "options.h"
#include "run.h"

namespace cairn::python {
namespace {

// One image's side of the matches, as Python gives it.
struct Side {
  Side(const std::string& number, const Camera& camera, const Array<double>& points,
       const std::optional<Array<double>>& frames, const std::optional<Array<float>>& depths)
      : camera(camera), points("points" + number, points) {
    if (frames) SetFrames("frames" + number, *frames);
    if (depths) this->depths = ToDepthSamples("depths" + number, *depths);
  }
  MatchedPoints Matched() const { return {camera, points.span(), frames, depths}; }

  const Camera& camera;
  Points points;
  std::vector<Eigen::Matrix2d> frames;
  std::vector<DepthSample> depths;

 private:
  void SetFrames(const std::string& name, const Array<double>& array) {
    CheckShape(name, array, {-1, 2, 2});
    frames.resize(static_cast<size_t>(array.shape(0)));
    for (size_t i = 0; i < frames.size(); ++i) {
      frames[i] = Eigen::Matrix<double, 2, 2, Eigen::RowMajor>::Map(array.data() + 4 * i);
    }
  }
};

// With keypoints as COLMAP's six columns, frames are in the same array.
PairReport Verify(const Camera& camera1, const Array<double>& points1, const Camera& camera2,
                  const Array<double>& points2, const std::optional<Array<double>>& frames1,
                  const std::optional<Array<double>>& frames2,
                  const std::optional<Array<float>>& depths1,
                  const std::optional<Array<float>>& depths2, const std::string& verifier,
                  bool are_best_first, const py::object& options, uint64_t seed) {
  const Side side1("1", camera1, points1, frames1, depths1);
  const Side side2("2", camera2, points2, frames2, depths2);
  const VerifyPairOptions verify_options{.verifier = VerifierKindFromName(verifier),
                                         .verification = ToOptions<TwoViewOptions>(options),
                                         .are_best_first = are_best_first};
  const Unlocked unlocked;
  return VerifyPair(side1.Matched(), side2.Matched(), verify_options, {.seed = seed});
}

py::array_t<uint32_t> InliersOf(const PairReport& report) {
  std::vector<uint32_t> inliers;
  for (const FeatureMatch& match : report.geometry.inlier_matches) inliers.push_back(match.point1);
  return MoveToArray<uint32_t, 1>(std::move(inliers));
}

void BindGeometries(py::module_& m) {
  py::class_<TwoViewGeometry>(m, "TwoViewGeometry", "What verification found between two images.")
      .def(py::init<>())
      .def_property_readonly(
          "config", EnumName(&TwoViewGeometry::config, TwoViewConfigName),
          "The kind of the pair: 'calibrated', 'uncalibrated', 'planar', 'panoramic', ...")
      .def_readonly("cam2_from_cam1", &TwoViewGeometry::cam2_from_cam1,
                    "x2 = R x1 + t with |t| = 1, or None.")
      .def_readonly("E", &TwoViewGeometry::E, "x2^T E x1 = 0 for points at depth 1, or None.")
      .def_readonly("F", &TwoViewGeometry::F, "x2^T F x1 = 0 for pixels, or None.")
      .def_readonly("H", &TwoViewGeometry::H, "x2 ~ H x1 for pixels, or None.")
      .def_property_readonly(
          "inlier_matches", [](const TwoViewGeometry& g) { return FromMatches(g.inlier_matches); },
          "(n, 2) indices of keypoints.");
}

void BindReport(py::module_& m) {
  py::class_<PairReport>(m, "PairReport", "The result of verify_pair.")
      .def_property_readonly("status", EnumName(&PairReport::status, PairStatusName),
                             "'verified', or why there is no result.")
      .def_readonly("geometry", &PairReport::geometry)
      .def_property_readonly(
          "cam2_from_cam1", [](const PairReport& r) { return r.geometry.cam2_from_cam1; },
          "x2 = R x1 + t with |t| = 1, or None.")
      .def_property_readonly("inliers", &InliersOf, "(n,) indices of matches.")
      .def_property_readonly(
          "verifier", [](const PairReport& r) { return r.verifier; }, "The step that found it.")
      .def_readonly("num_inliers", &PairReport::num_inliers)
      .def_readonly("num_iterations", &PairReport::num_iterations, "Hypotheses generated.")
      .def_readonly("score", &PairReport::score)
      .def_readonly("residual_px", &PairReport::residual_px, "Median Sampson error of the inliers.")
      .def_readonly("triangulation_angle_deg", &PairReport::triangulation_angle_deg,
                    "Median over what the pose explains.");
}

}  // namespace

void BindPairs(py::module_& m) {
  BindGeometries(m);
  BindReport(m);
  m.def("verify_pair", &Verify, py::arg("camera1"), py::arg("points1"), py::arg("camera2"),
        py::arg("points2"), py::kw_only(), py::arg("frames1") = py::none(),
        py::arg("frames2") = py::none(), py::arg("depths1") = py::none(),
        py::arg("depths2") = py::none(), py::arg("verifier") = "cascade",
        py::arg("are_best_first") = false, py::arg("options") = py::none(), py::arg("seed") = 0,
        R"(The relative pose of two images from their matches, many of which may be wrong.

Row i of the arrays of both images belongs to match i: points (n, 2) in pixels; frames (n, 2, 2),
affine shapes whose columns are axes in pixels; depths (n, 3), z-depth in the image's own unit and
its gradient per pixel, NaN where there is none. Frames and depths may be left out: with both, one
match gives a hypothesis; depth alone takes three, neither five. Unless
has_prior_focal_length of both cameras is True, a pair is 'uncalibrated' in place of 'calibrated':
the pose is of focal lengths that are guesses.)");
}

}  // namespace cairn::python
