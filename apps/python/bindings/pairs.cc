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

using Rows = std::vector<point2D_t>;

// The named rows of an argument.
template <class Row>
void TakeRows(const std::string& name, const Rows& indices, std::vector<Row>& rows) {
  std::vector<Row> taken;
  for (const point2D_t index : indices) {
    if (index >= rows.size()) {
      throw ConfigError("matches", "there is no row " + std::to_string(index) + " of " + name +
                                       ", which has " + std::to_string(rows.size()));
    }
    taken.push_back(rows[index]);
  }
  rows = std::move(taken);
}

// One image's side of the matches, as Python gives it.
struct Side {
  Side(const std::string& number, const Camera& camera, const Array<double>& points,
       const std::optional<Array<double>>& frames, const std::optional<Array<float>>& depths,
       const std::optional<Rows>& matched)
      : camera(camera), points(Points("points" + number, points).vector()) {
    if (frames) SetFrames("frames" + number, *frames);
    if (depths) this->depths = ToDepthSamples("depths" + number, *depths);
    if (!matched) return;
    const size_t size = this->points.size();
    if (frames) CheckSize("frames" + number, this->frames.size(), size);
    if (depths) CheckSize("depths" + number, this->depths.size(), size);
    TakeRows("points" + number, *matched, this->points);
    if (frames) TakeRows("frames" + number, *matched, this->frames);
    if (depths) TakeRows("depths" + number, *matched, this->depths);
  }
  MatchedPoints Matched() const { return {camera, points, frames, depths}; }

  const Camera& camera;
  std::vector<Eigen::Vector2d> points;
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

struct VerifiedPair : PairReport {
  std::vector<uint32_t> inliers;  // indices of matches
};

VerifiedPair Verify(const Camera& camera1, const Array<double>& points1, const Camera& camera2,
                    const Array<double>& points2, const py::object& given_matches,
                    const std::optional<Array<double>>& frames1,
                    const std::optional<Array<double>>& frames2,
                    const std::optional<Array<float>>& depths1,
                    const std::optional<Array<float>>& depths2, const std::string& verifier,
                    bool are_best_first, const py::object& options, uint64_t seed) {
  std::optional<Rows> rows1, rows2;
  const bool has_matches = !given_matches.is_none();
  const FeatureMatches matches = has_matches ? ToMatches(given_matches) : FeatureMatches();
  if (has_matches) {
    for (std::optional<Rows>* rows : {&rows1, &rows2}) rows->emplace();
    for (const auto& [point1, point2] : matches) {
      rows1->push_back(point1);
      rows2->push_back(point2);
    }
  }
  const Side side1("1", camera1, points1, frames1, depths1, rows1);
  const Side side2("2", camera2, points2, frames2, depths2, rows2);
  const VerifyPairOptions verify_options{.verifier = VerifierKindFromName(verifier),
                                         .verification = ToOptions<TwoViewOptions>(options),
                                         .are_best_first = are_best_first};
  const Unlocked unlocked;
  VerifiedPair result{VerifyPair(side1.Matched(), side2.Matched(), verify_options, {.seed = seed}),
                      {}};
  for (FeatureMatch& match : result.geometry.inlier_matches) {
    result.inliers.push_back(match.point1);
    if (has_matches) match = matches[match.point1];
  }
  return result;
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
      .def_readonly(
          "F", &TwoViewGeometry::F,
          "x2^T F x1 = 0 for pixels freed from the distortion that the cameras know, or None.")
      .def_readonly("H", &TwoViewGeometry::H, "x2 ~ H x1 for such pixels, or None.")
      .def_property_readonly(
          "inlier_matches", [](const TwoViewGeometry& g) { return FromMatches(g.inlier_matches); },
          "(n, 2) indices of keypoints: rows of points1 and points2 of verify_pair.");
}

void BindReport(py::module_& m) {
  py::class_<VerifiedPair>(m, "PairReport", "The result of verify_pair.")
      .def_property_readonly(
          "status", [](const VerifiedPair& r) { return PairStatusName(r.status); },
          "'verified', or why there is no result.")
      .def_readonly("geometry", &VerifiedPair::geometry)
      .def_property_readonly(
          "cam2_from_cam1", [](const VerifiedPair& r) { return r.geometry.cam2_from_cam1; },
          "x2 = R x1 + t with |t| = 1, or None.")
      .def_property_readonly(
          "inliers", [](const VerifiedPair& r) { return MoveToArray<uint32_t, 1>(r.inliers); },
          "(n,) indices of matches.")
      .def_property_readonly(
          "verifier", [](const VerifiedPair& r) { return r.verifier; }, "The step that found it.")
      .def_readonly("num_inliers", &VerifiedPair::num_inliers)
      .def_readonly("num_iterations", &VerifiedPair::num_iterations, "Hypotheses generated.")
      .def_readonly("score", &VerifiedPair::score)
      .def_readonly("residual_px", &VerifiedPair::residual_px,
                    "Median Sampson error of the inliers.")
      .def_readonly("triangulation_angle_deg", &VerifiedPair::triangulation_angle_deg,
                    "Median over what the pose explains.");
}

}  // namespace

void BindPairs(py::module_& m) {
  BindGeometries(m);
  BindReport(m);
  m.def("verify_pair", &Verify, py::arg("camera1"), py::arg("points1"), py::arg("camera2"),
        py::arg("points2"), py::arg("matches") = py::none(), py::kw_only(),
        py::arg("frames1") = py::none(), py::arg("frames2") = py::none(),
        py::arg("depths1") = py::none(), py::arg("depths2") = py::none(),
        py::arg("verifier") = "cascade", py::arg("are_best_first") = false,
        py::arg("options") = py::none(), py::arg("seed") = 0,
        R"(The relative pose of two images from their matches, many of which may be wrong.

Of keypoints: points (n, 2) in pixels; frames (n, 2, 2), affine shapes whose columns are axes in
pixels; depths (n, 3), z-depth in the image's own unit and its gradient per pixel, NaN where there
is none. matches: (m, 2) rows of the first and the second image's arrays; without it, row i of one
belongs to row i of the other. Frames and depths may be left out: with both, one match gives a
hypothesis; depth alone takes three, neither five. Unless
has_prior_focal_length of both cameras is True, a pair is 'uncalibrated' in place of 'calibrated':
the pose is of focal lengths that are guesses.)");
}

}  // namespace cairn::python
