#include "cairn/scene/reconstruction.h"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <sstream>

#include "arrays.h"
#include "bindings.h"
#include "cairn/base/error.h"
#include "cairn/evaluation/pose_evaluation.h"
#include "cairn/io/colmap_model.h"
#include "cairn/io/model.h"
#include "cairn/io/ply.h"
#include "run.h"

namespace cairn::python {
namespace {

using std::filesystem::path;

// A map of the reconstruction as a dictionary whose values are changed in place. Nothing can be
// removed, so that what Python holds stays valid.
template <class Map>
void BindMap(py::module_& m, const char* name) {
  using Key = typename Map::key_type;
  using Value = typename Map::mapped_type;
  constexpr auto kInside = py::return_value_policy::reference_internal;
  const auto keys = [](Map& map) { return py::make_key_iterator(map.begin(), map.end()); };
  const auto find = [](Map& map, Key key) -> Value& {
    const auto entry = map.find(key);
    if (entry == map.end()) throw py::key_error(std::to_string(key));
    return entry->second;
  };
  // As of a dict: integers of NumPy are integers, and whatever is none is not in it.
  const auto contains = [](const Map& map, const py::object& key) {
    const auto index = py::reinterpret_steal<py::object>(PyNumber_Index(key.ptr()));
    int is_out_of_range = 0;
    const long long id = index ? PyLong_AsLongLongAndOverflow(index.ptr(), &is_out_of_range) : -1;
    PyErr_Clear();
    return is_out_of_range == 0 && std::in_range<Key>(id) && map.contains(static_cast<Key>(id));
  };
  py::class_<Map>(m, name, "A dictionary by id, in the order of the ids.")
      .def("__len__", [](const Map& map) { return map.size(); })
      .def("__contains__", contains)
      .def("__getitem__", find, py::arg("id"), kInside)
      .def(
          "get",
          [](const py::object& self, const py::object& key, const py::object& other) {
            return self.contains(key) ? py::object(self[key]) : other;
          },
          py::arg("id"), py::arg("default") = py::none())
      .def("__iter__", keys, py::keep_alive<0, 1>())
      .def("keys", keys, py::keep_alive<0, 1>())
      .def(
          "values",
          [](Map& map) { return py::make_value_iterator<kInside>(map.begin(), map.end()); },
          py::keep_alive<0, 1>())
      .def(
          "items", [](Map& map) { return py::make_iterator<kInside>(map.begin(), map.end()); },
          py::keep_alive<0, 1>());
}

struct Point2D {
  Eigen::Vector2d xy;
  point3D_t point3D_id;
};

std::vector<Point2D> Points2DOf(const RegisteredImage& image) {
  std::vector<Point2D> points(image.points2D.size());
  for (size_t i = 0; i < points.size(); ++i) {
    points[i] = {image.points2D[i], image.point3D_ids[i]};
  }
  return points;
}

// Views into the image, which they keep alive.
py::array KeypointsOf(const py::object& self) {
  auto& points = self.cast<RegisteredImage&>().points2D;
  return py::array_t<double>({static_cast<py::ssize_t>(points.size()), py::ssize_t{2}},
                             reinterpret_cast<double*>(points.data()), self);
}

// A copy that cannot be written to, lest it be taken for a view.
py::array Point3DIdsOf(const RegisteredImage& image) {
  py::array ids = MoveToArray<point3D_t, 1>(image.point3D_ids);
  ids.attr("setflags")(py::arg("write") = false);
  return ids;
}

RegisteredImage MakeImage(const py::object& name, const Rigid3d& cam_from_world, camera_t camera_id,
                          image_t image_id, const Array<double>& points2D) {
  RegisteredImage image;
  image.image = {image_id, FromName(name), camera_id};
  image.cam_from_world = cam_from_world;
  image.points2D = Points("points2D", points2D).vector();
  CheckAllFinite("points2D", image.points2D);
  image.point3D_ids.assign(image.points2D.size(), kInvalidPoint3DId);
  return image;
}

void BindImage(py::module_& m) {
  py::class_<Point2D>(m, "Point2D", "A keypoint and the point that it shows.")
      .def_readonly("xy", &Point2D::xy, "Pixels.")
      .def_readonly("point3D_id", &Point2D::point3D_id)
      .def("has_point3D", [](const Point2D& p) { return p.point3D_id != kInvalidPoint3DId; });
  py::class_<RegisteredImage>(m, "Image", "A photograph with a pose.")
      .def(py::init(&MakeImage), py::arg("name"), py::arg("cam_from_world") = Rigid3d(),
           py::arg("camera_id") = kInvalidCameraId, py::arg("image_id") = kInvalidImageId,
           py::arg("points2D") = Array<double>(std::vector<py::ssize_t>{0, 2}))
      .def_property_readonly("image_id", [](const RegisteredImage& i) { return i.image.image_id; })
      .def_property_readonly("camera_id",
                             [](const RegisteredImage& i) { return i.image.camera_id; })
      .def_property_readonly("name", [](const RegisteredImage& i) { return ToName(i.image.name); })
      .def_readwrite("cam_from_world", &RegisteredImage::cam_from_world)
      .def("__repr__",
           [](const RegisteredImage& i) {
             return "Image(image_id=" + std::to_string(i.image.image_id) +
                    ", name=" + std::string(py::repr(ToName(i.image.name))) +
                    ", num_keypoints=" + std::to_string(i.points2D.size()) + ")";
           })
      .def("projection_center", [](const RegisteredImage& i) { return i.cam_from_world.Center(); })
      .def_property_readonly("points2D", &Points2DOf, "A list of Point2D.")
      .def_property_readonly("keypoints", &KeypointsOf, "(n, 2) pixels; a view, not a copy.")
      .def_property_readonly("point3D_ids", &Point3DIdsOf,
                             "(n,) ids of points; INVALID_POINT3D_ID: none.");
}

void CheckFinite(const Eigen::Vector3d& xyz) {
  if (!xyz.allFinite()) throw ConfigError("xyz", "is not finite");
}

void BindPoint(py::module_& m) {
  py::class_<TrackElement>(m, "TrackElement", "One keypoint of one image.")
      .def(py::init([](image_t image_id, point2D_t index) {
             return TrackElement{image_id, index};
           }),
           py::arg("image_id"), py::arg("point2D_idx"))
      .def_readonly("image_id", &TrackElement::image_id)
      .def_readonly("point2D_idx", &TrackElement::point2D);
  struct TrackView {
    Track elements;
  };
  py::class_<TrackView>(m, "Track", "The keypoints that show a point.")
      .def_readonly("elements", &TrackView::elements)
      .def("length", [](const TrackView& track) { return track.elements.size(); });
  py::class_<Point3D>(m, "Point3D", "A point of the scene.")
      .def_property(
          "xyz", [](const Point3D& point) -> const Eigen::Vector3d& { return point.xyz; },
          [](Point3D& point, const Eigen::Vector3d& xyz) {
            CheckFinite(xyz);
            point.xyz = xyz;
            point.error_px = -1;
          })
      .def_readwrite("color", &Point3D::color, "RGB, from 0 to 255.")
      .def_readonly("error", &Point3D::error_px,
                    "Mean reprojection error, pixels; -1: not computed, inf: behind a camera.")
      .def_property_readonly("track", [](const Point3D& point) { return TrackView{point.track}; });
}

// Gives an unset id the next of the map. Throws ConfigError where there is none, and for one that
// is there.
template <class Map>
void GiveId(const Map& map, const std::string& name, uint32_t& id) {
  static_assert(kInvalidCameraId == kInvalidImageId);
  if (id == kInvalidImageId) id = map.empty() ? 1 : map.rbegin()->first + 1;
  if (id == kInvalidImageId) throw ConfigError(name, "the largest one is taken; give one");
  if (map.contains(id)) throw ConfigError(name, std::to_string(id) + " is there already");
}

camera_t AddCamera(Reconstruction& model, Camera camera) {
  GiveId(model.cameras, "camera_id", camera.camera_id);
  return model.cameras.emplace(camera.camera_id, camera).first->first;
}

image_t AddImage(Reconstruction& model, RegisteredImage image) {
  CheckIsThere("camera_id", "camera", image.image.camera_id, model.cameras);
  GiveId(model.images, "image_id", image.image.image_id);
  return model.images.emplace(image.image.image_id, image).first->first;
}

// A TrackElement, or a pair.
TrackElement ToElement(py::handle given) {
  if (py::isinstance<TrackElement>(given)) return given.cast<TrackElement>();
  try {
    const auto [image_id, index] = given.cast<std::pair<image_t, point2D_t>>();
    return {image_id, index};
  } catch (const py::cast_error&) {
    throw ConfigError("track", std::string(py::repr(given)) +
                                   " is no pair of an image id and a keypoint's index");
  }
}

point3D_t AddPoint(Reconstruction& model, const Eigen::Vector3d& xyz, const py::iterable& track,
                   const std::array<uint8_t, 3>& color) {
  CheckFinite(xyz);
  Point3D point;
  point.xyz = xyz;
  point.color = color;
  for (const py::handle given : track) {
    const auto [image_id, index] = ToElement(given);
    const auto image = model.images.find(image_id);
    if (image == model.images.end() || index >= image->second.points2D.size() ||
        image->second.point3D_ids[index] != kInvalidPoint3DId) {
      throw ConfigError("track", "keypoint " + std::to_string(index) + " of image " +
                                     std::to_string(image_id) + " is absent or shows a point");
    }
    point.track.push_back({image_id, index});
  }
  std::sort(point.track.begin(), point.track.end());
  if (std::adjacent_find(point.track.begin(), point.track.end()) != point.track.end()) {
    throw ConfigError("track", "a keypoint is there twice");
  }
  return model.AddPoint3D(point);
}

std::string SummaryOf(const Reconstruction& model) {
  std::ostringstream text;
  text << "Reconstruction(num_cameras=" << model.cameras.size()
       << ", num_images=" << model.images.size() << ", num_points3D=" << model.points3D.size()
       << ")";
  return text.str();
}

double MeanError(const Reconstruction& model, int num_threads) {
  CheckNumThreads(num_threads);
  const Unlocked unlocked;
  return model.MeanReprojectionErrorPx(num_threads);
}

py::array PointPositions(const Reconstruction& model) {
  return StackMatrices(model.points3D, [](const auto& entry) { return entry.second.xyz; });
}

py::array PointColors(const Reconstruction& model) {
  std::vector<std::array<uint8_t, 3>> colors;
  for (const auto& [id, point] : model.points3D) colors.push_back(point.color);
  return MoveToArray<uint8_t, 3>(std::move(colors));
}

void BindModel(py::module_& m) {
  constexpr auto kInside = py::return_value_policy::reference_internal;
  py::class_<Reconstruction>(m, "Reconstruction",
                             "Cameras, images with poses, and points; names as in pycolmap.")
      .def(py::init<>())
      .def(py::init([](const path& folder) {
             const Unlocked unlocked;
             return ReadModel(folder.string());
           }),
           py::arg("path"),
           "Reads a COLMAP model, a Bundler file (*.out) or Strecha's .camera files.")
      .def_readonly("cameras", &Reconstruction::cameras, kInside)
      .def_readonly("images", &Reconstruction::images, kInside)
      .def_readonly("points3D", &Reconstruction::points3D, kInside)
      .def("add_camera", &AddCamera, py::arg("camera"),
           "One without an id gets the next. Returns the id.")
      .def("add_image", &AddImage, py::arg("image"),
           "One without an id gets the next. Returns the id.")
      .def(
          "add_point3D", &AddPoint, py::arg("xyz"), py::arg("track"),
          py::arg("color") = std::array<uint8_t, 3>{0, 0, 0},
          "`track`: pairs of an image id and a keypoint's index, or TrackElements. Returns the id.")
      .def("point_positions", &PointPositions, "(n, 3), in the order of points3D.")
      .def("point_colors", &PointColors, "(n, 3) RGB, in the order of points3D.")
      .def("num_images", [](const Reconstruction& r) { return r.images.size(); })
      .def("num_points3D", [](const Reconstruction& r) { return r.points3D.size(); })
      .def("compute_num_observations", &Reconstruction::NumObservations)
      .def("compute_mean_track_length", &Reconstruction::MeanTrackLength)
      .def("compute_mean_reprojection_error", &MeanError, py::arg("num_threads") = 1, "Pixels.")
      .def(
          "write",
          [](const Reconstruction& r, const path& folder) {
            const Unlocked unlocked;
            WriteColmapModel(r, folder.string());
          },
          py::arg("path"), "COLMAP's binary files; makes the folder.")
      .def(
          "write_text",
          [](const Reconstruction& r, const path& folder) {
            const Unlocked unlocked;
            WriteColmapModel(r, folder.string(), ColmapModelFormat::kText);
          },
          py::arg("path"), "COLMAP's text files; makes the folder.")
      .def(
          "export_PLY",
          [](const Reconstruction& r, const path& file) {
            const Unlocked unlocked;
            WritePly(r, file.string());
          },
          py::arg("path"), "Points and cameras.")
      .def("__copy__", [](const Reconstruction& r) { return r; })
      .def(
          "__deepcopy__", [](const Reconstruction& r, const py::dict&) { return r; },
          py::arg("memo"))
      .def("__repr__", &SummaryOf);
}

// A reconstruction, or the path of a model.
PosedCameras PosesOf(const std::string& name, const py::object& model) {
  if (py::isinstance<Reconstruction>(model)) {
    return PosedCamerasOf(model.cast<const Reconstruction&>());
  }
  if (!py::isinstance<py::str>(model) && !py::hasattr(model, "__fspath__")) {
    throw ConfigError(name, "neither a Reconstruction nor the path of a model");
  }
  const std::string file = model.cast<path>().string();
  const Unlocked unlocked;
  return PosedCamerasOf(ReadModel(file, {.read_points = false}));
}

PoseEvaluation Evaluate(const py::object& model, const py::object& reference) {
  const PosedCameras estimate = PosesOf("model", model);
  const PosedCameras truth = PosesOf("reference", reference);
  const Unlocked unlocked;
  return EvaluatePoses(estimate, truth);
}

void BindEvaluation(py::module_& m) {
  py::class_<PoseEvaluation>(m, "PoseEvaluation", "How exact the cameras of a model are.")
      .def_readonly("num_reference", &PoseEvaluation::num_reference)
      .def_readonly("num_registered", &PoseEvaluation::num_registered)
      .def_property_readonly(
          "auc",
          [](const PoseEvaluation& evaluation) {
            py::dict auc;
            for (size_t i = 0; i < kAucThresholdsDeg.size(); ++i) {
              auc[py::int_(static_cast<int>(kAucThresholdsDeg[i]))] = evaluation.auc[i];
            }
            return auc;
          },
          "By threshold in degrees: the area under the recall curve of pairs, from 0 to 1.")
      .def_readonly("relative_rotation_median_deg", &PoseEvaluation::relative_rotation_median_deg)
      .def_readonly("relative_translation_median_deg",
                    &PoseEvaluation::relative_translation_median_deg)
      .def(
          "to_dict",
          [](const PoseEvaluation& evaluation) {
            return FromJson(PoseEvaluationToJson(evaluation));
          },
          "All figures, with those of each image, as global_sfm evaluate writes them.")
      .def("__str__", &FormatPoseEvaluation);
  m.def("evaluate", &Evaluate, py::arg("model"), py::arg("reference"),
        "Compares camera poses with a reference, by image names. Each is a Reconstruction or the "
        "path of a model (COLMAP, Bundler, Strecha).");
}

}  // namespace

void BindReconstruction(py::module_& m) {
  m.attr("INVALID_POINT3D_ID") = kInvalidPoint3DId;
  BindMap<std::map<camera_t, Camera>>(m, "CameraMap");
  BindImage(m);
  BindPoint(m);
  BindMap<std::map<image_t, RegisteredImage>>(m, "ImageMap");
  BindMap<std::map<point3D_t, Point3D>>(m, "Point3DMap");
  BindModel(m);
  BindEvaluation(m);
}

}  // namespace cairn::python
