#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "arrays.h"
#include "bindings.h"
#include "cairn/base/error.h"
#include "cairn/mapper/view_edges.h"
#include "cairn/view_graph/view_graph_builder.h"
#include "options.h"
#include "run.h"

namespace cairn::python {
namespace {

ViewGraph Build(std::vector<image_t> image_ids, std::vector<ViewEdge> edges,
                const py::object& options) {
  const auto settings = ToOptions<ViewGraphBuilderOptions>(options);
  const Unlocked unlocked;
  return BuildViewGraph(std::move(image_ids), std::move(edges), settings).graph;
}

std::vector<ViewEdge> ToEdges(const py::object& pairs, const Array<double>& rotations,
                              const Array<double>& translations, const py::object& num_inliers) {
  const auto ids = ToPairs(pairs);
  const auto size = static_cast<py::ssize_t>(ids.size());
  const std::vector<Eigen::Quaterniond> relative = ToRotations(rotations, ids.size());
  CheckShape("translations", translations, {size, 3});
  const std::vector<uint32_t> inliers = ToIndices("num_inliers", num_inliers, 1, uint64_t{1} << 31);
  CheckSize("num_inliers", inliers.size(), ids.size());
  std::vector<ViewEdge> edges(ids.size());
  std::set<image_pair_t> seen;
  for (size_t i = 0; i < edges.size(); ++i) {
    const Eigen::Vector3d t = Row3(translations, i);
    if (!t.allFinite())
      throw ConfigError("translations[" + std::to_string(i) + "]", "is not finite");
    if (!seen.insert(ImagePairToPairId(ids[i].first, ids[i].second)).second) {
      throw ConfigError("pairs", std::to_string(ids[i].first) + " and " +
                                     std::to_string(ids[i].second) + " are there twice");
    }
    ViewEdge& edge = edges[i];
    edge.image_id1 = ids[i].first;
    edge.image_id2 = ids[i].second;
    edge.cam2_from_cam1 = Rigid3d(relative[i], t.stableNormalized());
    edge.num_inliers = static_cast<int>(inliers[i]);
    if (edge.image_id1 < edge.image_id2) continue;
    std::swap(edge.image_id1, edge.image_id2);
    edge.cam2_from_cam1 = Inverse(edge.cam2_from_cam1);
  }
  return edges;
}

ViewGraph FromEdges(const py::object& pairs, const Array<double>& rotations,
                    const Array<double>& translations, const py::object& num_inliers,
                    const py::object& options) {
  std::vector<ViewEdge> edges = ToEdges(pairs, rotations, translations, num_inliers);
  std::set<image_t> images;
  for (const ViewEdge& edge : edges) images.insert({edge.image_id1, edge.image_id2});
  return Build({images.begin(), images.end()}, std::move(edges), options);
}

ViewGraph FromDatabase(const std::filesystem::path& path, const py::object& options) {
  const Database database(path.string(), Database::Mode::kSnapshot);
  std::vector<image_t> images;
  for (const Image& image : database.ReadImages()) images.push_back(image.image_id);
  return Build(std::move(images), ReadViewEdges(database), options);
}

// Getters of an array and of a list with a value of each edge.
template <class Scalar, class Get>
auto Column(const Get& get) {
  return [get](const ViewGraph& graph) {
    py::array_t<Scalar> column(static_cast<py::ssize_t>(graph.edges.size()));
    std::ranges::transform(graph.edges, column.mutable_data(), get);
    return column;
  };
}

template <class Get>
auto Texts(const Get& get) {
  return [get](const ViewGraph& graph) {
    std::vector<std::string> texts;
    for (const ViewEdge& edge : graph.edges) texts.emplace_back(std::invoke(get, edge));
    return texts;
  };
}

py::array_t<image_t> EdgePairs(const ViewGraph& graph) {
  std::vector<std::array<image_t, 2>> pairs;
  for (const ViewEdge& edge : graph.edges) pairs.push_back({edge.image_id1, edge.image_id2});
  return MoveToArray<image_t, 2>(std::move(pairs));
}

void BindColumns(py::class_<ViewGraph>& c) {
  c.def_property_readonly("pairs", &EdgePairs,
                          "(n, 2) image ids, the smaller one first, ascending.")
      .def_property_readonly(
          "rotations",
          [](const ViewGraph& g) {
            return StackMatrices(
                g.edges, [](const ViewEdge& e) { return e.cam2_from_cam1.RotationMatrix(); });
          },
          "(n, 3, 3) of cam2_from_cam1.")
      .def_property_readonly(
          "translations",
          [](const ViewGraph& g) {
            return StackMatrices(g.edges,
                                 [](const ViewEdge& e) { return e.cam2_from_cam1.translation; });
          },
          "(n, 3) of cam2_from_cam1, of length 1; 0 where the camera turned without moving.")
      .def_property_readonly("num_inliers", Column<int>(&ViewEdge::num_inliers))
      .def_property_readonly("residuals_px", Column<double>(&ViewEdge::residual_px),
                             "Median Sampson error of the inliers; 0: unknown.")
      .def_property_readonly("triangulation_angles_deg",
                             Column<double>(&ViewEdge::triangulation_angle_deg),
                             "Median over the inliers; 0: unknown.")
      .def_property_readonly("verifiers", Texts(&ViewEdge::verifier),
                             "What found each pose; '': unknown.")
      .def_property_readonly("reasons",
                             Texts([](const ViewEdge& e) { return EdgeRemovalName(e.removal); }),
                             "'in_use', or why an edge was taken out.")
      .def_property_readonly("is_active", Column<bool>(&ViewEdge::IsActive));
}

}  // namespace

void BindViewGraph(py::module_& m) {
  py::class_<ViewGraph> c(m, "ViewGraph",
                          "Verified pairs as arrays with a row an edge; none is left out, and each "
                          "has the reason why it is not in use.");
  c.def_static("from_database", &FromDatabase, py::arg("path"), py::kw_only(),
               py::arg("options") = py::none())
      .def_static("from_edges", &FromEdges, py::arg("pairs"), py::arg("rotations"),
                  py::arg("translations"), py::arg("num_inliers"), py::kw_only(),
                  py::arg("options") = py::none(),
                  "Finds edges whose loops do not close, and duplicate structure. "
                  "Arrays as the attributes of these names.")
      .def("__len__", [](const ViewGraph& g) { return g.edges.size(); })
      .def_property_readonly(
          "image_ids", [](const ViewGraph& g) { return MoveToArray<image_t, 1>(g.image_ids); })
      .def("components", &ActiveComponents, "Image ids that edges in use join, most images first.");
  BindColumns(c);
}

}  // namespace cairn::python
