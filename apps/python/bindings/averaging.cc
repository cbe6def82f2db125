#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <map>
#include <set>

#include "arrays.h"
#include "bindings.h"
#include "cairn/base/error.h"
#include "cairn/intrinsics/focal_calibration.h"
#include "cairn/rotation_averaging/rotation_averaging.h"
#include "cairn/translation_averaging/translation_averaging.h"
#include "options.h"
#include "run.h"

namespace cairn::python {
namespace {

// Ids of a report's map, in their order.
template <class Map>
py::array_t<image_t> IdsOf(const Map& map) {
  std::vector<image_t> ids;
  for (const auto& [id, value] : map) ids.push_back(id);
  return MoveToArray<image_t, 1>(std::move(ids));
}

std::vector<RotationEdge> ToRotationEdges(const py::object& pairs, const Array<double>& rotations,
                                          const std::optional<Array<double>>& weights) {
  const auto ids = ToPairs(pairs);
  const std::vector<Eigen::Quaterniond> relative = ToRotations(rotations, ids.size());
  if (weights) CheckShape("weights", *weights, {static_cast<py::ssize_t>(ids.size())});
  std::vector<RotationEdge> edges(ids.size());
  for (size_t i = 0; i < edges.size(); ++i) {
    edges[i] = {ids[i].first, ids[i].second, relative[i], weights ? weights->data()[i] : 1.0};
    CheckPositive("weights[" + std::to_string(i) + "]", edges[i].weight);
  }
  return edges;
}

RotationAveragingReport Rotations(const py::object& pairs, const Array<double>& rotations,
                                  const std::optional<Array<double>>& weights,
                                  const py::object& options, int num_threads,
                                  const py::object& progress) {
  const std::vector<RotationEdge> edges = ToRotationEdges(pairs, rotations, weights);
  const auto settings = ToOptions<RotationAveragingOptions>(options);
  return ResultOfStep("average_rotations", {0, num_threads, progress}, [&](const RunContext& run) {
    return AverageRotations(edges, settings, run);
  });
}

void BindRotations(py::module_& m) {
  using Report = RotationAveragingReport;
  py::class_<Report>(m, "RotationAveragingReport", "The result of average_rotations.")
      .def_property_readonly("status", EnumName(&Report::status, RotationAveragingStatusName))
      .def_property_readonly("image_ids", [](const Report& r) { return IdsOf(r.cam_from_world); })
      .def_property_readonly(
          "rotations",
          [](const Report& r) {
            return StackMatrices(r.cam_from_world,
                                 [](const auto& entry) { return entry.second.toRotationMatrix(); });
          },
          "(n, 3, 3) cam_from_world, in the order of image_ids. Each component has its own frame.")
      .def_readonly("components", &Report::components, "Image ids, the largest component first.")
      .def_property_readonly(
          "edge_residuals_deg",
          [](const Report& r) { return MoveToArray<double, 1>(r.edge_residuals_deg); },
          "One an edge, in the order given.")
      .def_property_readonly("edge_rejected",
                             [](const Report& r) { return MoveToArray<bool, 1>(r.edge_rejected); })
      .def_readonly("num_rejected", &Report::num_rejected)
      .def_readonly("median_residual_deg", &Report::median_residual_deg);
  m.def("average_rotations", &Rotations, py::arg("pairs"), py::arg("rotations"), py::kw_only(),
        py::arg("weights") = py::none(), py::arg("options") = py::none(),
        py::arg("num_threads") = 0, py::arg("progress") = py::none(),
        "Global rotations from relative ones. pairs: (n, 2) image ids; rotations: (n, 3, 3) "
        "matrices cam2_from_cam1; weights: (n,) positive, such as numbers of inliers, which choose "
        "the first spanning tree, and weigh the pairs by the option weight_power.");
}

// Row i of the directions of an argument.
Eigen::Vector3d DirectionOf(const std::string& name, const Array<double>& directions, size_t i) {
  const Eigen::Vector3d direction = Row3(directions, i);
  if (!(direction.norm() > 0) || !direction.allFinite()) {
    throw ConfigError(name + "[" + std::to_string(i) + "]", "is zero or not finite");
  }
  return direction;
}

std::vector<PointDirections> ToTracks(const std::optional<py::object>& point_ids,
                                      const std::optional<py::object>& image_ids,
                                      const std::optional<Array<double>>& directions) {
  std::vector<PointDirections> tracks;
  if (!point_ids && !image_ids && !directions) return tracks;
  if (!point_ids || !image_ids || !directions) {
    throw ConfigError("ray_points", "ray_points, ray_images and ray_directions come together");
  }
  const std::vector<uint32_t> points = ToIndices("ray_points", *point_ids, 1);
  const std::vector<uint32_t> images = ToIndices("ray_images", *image_ids, 1);
  const auto size = static_cast<py::ssize_t>(points.size());
  CheckSize("ray_images", images.size(), points.size());
  CheckShape("ray_directions", *directions, {size, 3});
  std::map<uint32_t, size_t> track_of;
  std::set<std::pair<uint32_t, image_t>> seen;
  for (size_t i = 0; i < points.size(); ++i) {
    if (!seen.insert({points[i], images[i]}).second) {
      throw ConfigError("ray_points", "image " + std::to_string(images[i]) + " sees point " +
                                          std::to_string(points[i]) + " twice");
    }
    const size_t track = track_of.try_emplace(points[i], tracks.size()).first->second;
    tracks.resize(std::max(tracks.size(), track + 1));
    tracks[track].rays.push_back({images[i], DirectionOf("ray_directions", *directions, i)});
  }
  return tracks;
}

TranslationAveragingReport Translations(const py::object& pairs, const Array<double>& directions,
                                        const std::optional<py::object>& ray_points,
                                        const std::optional<py::object>& ray_images,
                                        const std::optional<Array<double>>& ray_directions,
                                        const py::object& options, uint64_t seed, int num_threads,
                                        const py::object& progress) {
  const auto ids = ToPairs(pairs);
  CheckShape("directions", directions, {static_cast<py::ssize_t>(ids.size()), 3});
  std::vector<DirectionEdge> edges(ids.size());
  for (size_t i = 0; i < edges.size(); ++i) {
    edges[i] = {ids[i].first, ids[i].second, DirectionOf("directions", directions, i)};
  }
  const auto tracks = ToTracks(ray_points, ray_images, ray_directions);
  const auto settings = ToOptions<TranslationAveragingOptions>(options);
  return ResultOfStep(
      "average_translations", {seed, num_threads, progress},
      [&](const RunContext& run) { return AverageTranslations(edges, tracks, settings, run); });
}

void BindTranslations(py::module_& m) {
  using Report = TranslationAveragingReport;
  py::class_<Report>(m, "TranslationAveragingReport", "The result of average_translations.")
      .def_property_readonly("status", EnumName(&Report::status, TranslationAveragingStatusName))
      .def_readonly("message", &Report::message, "Why there is no result.")
      .def_property_readonly("image_ids", [](const Report& r) { return IdsOf(r.centers); })
      .def_property_readonly(
          "centers",
          [](const Report& r) {
            return StackMatrices(r.centers, [](const auto& entry) { return entry.second; });
          },
          "(n, 3) in the order of image_ids: the mean is zero, the (upper) median distance from it "
          "1.")
      .def_readonly("not_rigid", &Report::not_rigid, "Images that the directions do not fix.")
      .def_property_readonly(
          "edge_is_filtered",
          [](const Report& r) { return MoveToArray<bool, 1>(r.edge_is_filtered); })
      .def_readonly("num_filtered", &Report::num_filtered)
      .def_readonly("median_edge_error_deg", &Report::median_edge_error_deg);
  m.def("average_translations", &Translations, py::arg("pairs"), py::arg("directions"),
        py::kw_only(), py::arg("ray_points") = py::none(), py::arg("ray_images") = py::none(),
        py::arg("ray_directions") = py::none(), py::arg("options") = py::none(),
        py::arg("seed") = 0, py::arg("num_threads") = 0, py::arg("progress") = py::none(),
        R"(Camera centers from directions, with known rotations.

pairs: (n, 2) image ids; directions: (n, 3) from the first center to the second, in the world frame
(R2^T -t, for cam2_from_cam1 = (R, t) and the global rotation R2). Rays to scene points may help:
(m,) ids of points, (m,) image ids and (m, 3) directions from the cameras, in the world frame.)");
}

FocalPair MakeFocalPair(camera_t camera_id1, camera_t camera_id2, const Eigen::Matrix3d& F,
                        const Array<double>& points1, const Array<double>& points2) {
  FocalPair pair{camera_id1, camera_id2, F, Points("points1", points1).vector(),
                 Points("points2", points2).vector()};
  if (pair.pixels1.size() != pair.pixels2.size()) {
    throw ConfigError("points2", "not as many as points1");
  }
  if (!F.allFinite()) throw ConfigError("F", "is not finite");
  CheckAllFinite("points1", pair.pixels1);
  CheckAllFinite("points2", pair.pixels2);
  return pair;
}

FocalCalibrationReport Focals(const std::vector<Camera>& cameras,
                              const std::vector<FocalPair>& pairs, const py::iterable& trusted,
                              const py::object& options, int num_threads,
                              const py::object& progress) {
  std::map<camera_t, Camera> by_id;
  for (const Camera& camera : cameras) {
    if (by_id.emplace(camera.camera_id, camera).second) continue;
    throw ConfigError("cameras", "two have the id " + std::to_string(camera.camera_id));
  }
  const std::set<camera_t> trusted_ids = ToIds("trusted", "camera", trusted, by_id);
  const auto settings = ToOptions<FocalCalibrationOptions>(options);
  return ResultOfStep("calibrate_focals", {0, num_threads, progress}, [&](const RunContext& run) {
    return CalibrateFocals(by_id, trusted_ids, pairs, settings, run);
  });
}

void BindFocals(py::module_& m) {
  py::class_<FocalPair>(m, "FocalPair",
                        "The matches of two images that agree with a fundamental matrix.")
      .def(py::init(&MakeFocalPair), py::arg("camera_id1"), py::arg("camera_id2"), py::arg("F"),
           py::arg("points1"), py::arg("points2"));
  py::class_<CalibratedFocal>(m, "CalibratedFocal", "What the pairs tell of a focal length.")
      .def_property_readonly("status", EnumName(&CalibratedFocal::status, FocalStatusName))
      .def_readonly("focal_before_px", &CalibratedFocal::focal_before_px)
      .def_readonly("focal_px", &CalibratedFocal::focal_px)
      .def_readonly("sigma", &CalibratedFocal::sigma, "Relative standard deviation.")
      .def_readonly("num_pairs", &CalibratedFocal::num_pairs)
      .def_readonly("num_agreeing", &CalibratedFocal::num_agreeing);
  py::class_<FocalCalibrationReport>(m, "FocalCalibrationReport", "The result of calibrate_focals.")
      .def_readonly("cameras", &FocalCalibrationReport::cameras, "CalibratedFocal by camera id.")
      .def_readonly("num_pairs", &FocalCalibrationReport::num_pairs)
      .def_readonly("num_pairs_agreeing", &FocalCalibrationReport::num_pairs_agreeing);
  m.def("calibrate_focals", &Focals, py::arg("cameras"), py::arg("pairs"), py::kw_only(),
        py::arg("trusted") = py::set(), py::arg("options") = py::none(), py::arg("num_threads") = 0,
        py::arg("progress") = py::none(),
        "Focal lengths from fundamental matrices (of verify_pair with cameras whose focal lengths "
        "are guesses). Cameras in `trusted` keep theirs.");
}

}  // namespace

void BindAveraging(py::module_& m) {
  BindRotations(m);
  BindTranslations(m);
  BindFocals(m);
}

}  // namespace cairn::python
