#include <pybind11/eigen.h>
#include <pybind11/operators.h>
#include <pybind11/stl.h>

#include <limits>
#include <sstream>

#include "arrays.h"
#include "bindings.h"
#include "cairn/base/error.h"
#include "cairn/base/options.h"
#include "cairn/camera/camera.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/math/so3.h"

namespace cairn::python {
namespace {

Eigen::Quaterniond RotationFromMatrix(const Eigen::Matrix3d& R) {
  constexpr double kMaxDefect = 1e-5;  // as of numbers rounded to six digits
  const auto rotation = ToRotation(R, kMaxDefect);
  if (!rotation) throw ConfigError("matrix", "not a rotation");
  return *rotation;
}

// x, y, z, w, as pycolmap.
Eigen::Quaterniond RotationFromQuat(const Eigen::Vector4d& xyzw) {
  if (xyzw.isZero(0) || !xyzw.allFinite()) throw ConfigError("quat", "not a rotation");
  const Eigen::Vector4d unit = (xyzw / xyzw.cwiseAbs().maxCoeff()).normalized();
  return {unit(3), unit(0), unit(1), unit(2)};
}

const Eigen::Vector3d& Finite(const Eigen::Vector3d& translation) {
  if (!translation.allFinite()) throw ConfigError("translation", "must be finite");
  return translation;
}

Eigen::Matrix<double, 3, 4> MatrixOf(const Rigid3d& pose) {
  return (Eigen::Matrix<double, 3, 4>() << pose.RotationMatrix(), pose.translation).finished();
}

std::string ReprOf(const Rigid3d& pose) {
  const Eigen::IOFormat row(6, Eigen::DontAlignCols, ", ", ", ", "", "", "[", "]");
  std::ostringstream text;
  text << "Rigid3d(rotation_xyzw=" << pose.rotation.coeffs().transpose().format(row)
       << ", translation=" << pose.translation.transpose().format(row) << ")";
  return text.str();
}

Array<double> TransformPoints(const Rigid3d& pose, const Array<double>& points) {
  const bool is_one = points.ndim() == 1;
  CheckShape(
      "points", points,
      is_one ? std::initializer_list<py::ssize_t>{3} : std::initializer_list<py::ssize_t>{-1, 3});
  Array<double> moved =
      StackMatrices(Indices(points.size() / 3), [&](size_t i) { return pose * Row3(points, i); });
  return is_one ? Array<double>(moved.squeeze()) : moved;
}

void BindPoses(py::module_& m) {
  using Rotation = Eigen::Quaterniond;
  py::class_<Rotation>(m, "Rotation3d", "A rotation.")
      .def(py::init([] { return Rotation(Rotation::Identity()); }))
      .def(py::init(&RotationFromMatrix), py::arg("matrix"), "Of a 3 x 3 matrix.")
      .def_static("from_quat", &RotationFromQuat, py::arg("xyzw"))
      .def_property_readonly(
          "quat", [](const Rotation& r) -> Eigen::Vector4d { return r.coeffs(); }, "x, y, z, w")
      .def("matrix", [](const Rotation& r) { return r.toRotationMatrix(); })
      .def("inverse", [](const Rotation& r) { return r.conjugate(); })
      .def(
          "angle_to", [](const Rotation& a, const Rotation& b) { return AngleBetween(a, b); },
          py::arg("other"), "Radians.")
      .def(
          "__mul__", [](const Rotation& a, const Rotation& b) { return a * b; }, py::arg("other"));

  py::class_<Rigid3d>(m, "Rigid3d", "A rigid motion b_from_a: x_b = rotation x_a + translation.")
      .def(py::init<>())
      .def(py::init([](const Rotation& rotation, const Eigen::Vector3d& t) {
             return Rigid3d(rotation, Finite(t));
           }),
           py::arg("rotation"), py::arg("translation"))
      .def(py::init([](const Eigen::Matrix3d& R, const Eigen::Vector3d& t) {
             return Rigid3d(RotationFromMatrix(R), Finite(t));
           }),
           py::arg("rotation"), py::arg("translation"))
      .def_readwrite("rotation", &Rigid3d::rotation)
      .def_property(
          "translation",
          [](const Rigid3d& pose) -> const Eigen::Vector3d& { return pose.translation; },
          [](Rigid3d& pose, const Eigen::Vector3d& t) { pose.translation = Finite(t); })
      .def("matrix", &MatrixOf, "3 x 4: rotation and translation.")
      .def("inverse", [](const Rigid3d& pose) { return Inverse(pose); })
      .def("center", &Rigid3d::Center, "Of cam_from_world: the camera's center in the world.")
      .def(
          "__mul__", [](const Rigid3d& a, const Rigid3d& b) { return a * b; }, py::arg("other"))
      .def("__mul__", &TransformPoints, py::arg("points"), "Of (3,) or (n, 3) points.")
      .def("__repr__", &ReprOf);
}

CameraModel ModelFromName(const std::string& name) {
  std::vector<std::string> names;
  for (const auto& model : NamedCameraModels()) names.emplace_back(model.name);
  CheckChoice("model", name, names);
  return *CameraModelFromName(name);
}

void CheckCamera(const Camera& camera) {
  if (const std::string reason = camera.Validate(); !reason.empty()) {
    throw ConfigError("camera", reason);
  }
}

Camera MakeCamera(const std::string& model, int width, int height, std::vector<double> params,
                  camera_t camera_id, bool has_prior_focal_length) {
  Camera camera{camera_id, ModelFromName(model), width,
                height,    std::move(params),    has_prior_focal_length};
  CheckCamera(camera);
  return camera;
}

Camera CameraFromFocal(camera_t camera_id, const std::string& model, double focal_length, int width,
                       int height) {
  Camera camera = Camera::FromFocal(camera_id, ModelFromName(model), focal_length, width, height);
  CheckCamera(camera);
  return camera;
}

// Changes a camera, unless it became one that cannot be. One that cannot be, such as those without
// a size of a Bundler file, is mended value by value.
template <class Change>
void ChangeCamera(Camera& camera, const Change& change) {
  Camera changed = camera;
  change(changed);
  if (camera.Validate().empty()) CheckCamera(changed);
  camera = std::move(changed);
}

// Where the model has no value, rows are not numbers.
template <class Vector>
Vector OrNaN(const std::optional<Vector>& value) {
  return value.value_or(Vector::Constant(std::numeric_limits<double>::quiet_NaN()));
}

Array<double> ImgFromCam(const Camera& camera, const Array<double>& points) {
  CheckShape("points", points, {-1, 3});
  return StackMatrices(Indices(points.shape(0)),
                       [&](size_t i) { return OrNaN(camera.ImgFromRay(Row3(points, i))); });
}

Array<double> CamFromImg(const Camera& camera, const Array<double>& points) {
  return StackMatrices(Points("points", points).span(), [&](const Eigen::Vector2d& pixel) {
    return OrNaN(camera.CamFromImg(pixel));
  });
}

Array<double> RayFromImg(const Camera& camera, const Array<double>& points) {
  return StackMatrices(Points("points", points).span(), [&](const Eigen::Vector2d& pixel) {
    return OrNaN(camera.RayFromImg(pixel));
  });
}

std::string ReprOf(const Camera& camera) {
  std::ostringstream text;
  text << "Camera(camera_id=";
  if (camera.camera_id == kInvalidCameraId) text << "unset";
  if (camera.camera_id != kInvalidCameraId) text << camera.camera_id;
  text << ", model=" << CameraModelName(camera.model) << ", width=" << camera.width
       << ", height=" << camera.height << ", params=[";
  for (size_t i = 0; i < camera.params.size(); ++i) text << (i ? ", " : "") << camera.params[i];
  text << "])";
  return text.str();
}

void BindCamera(py::module_& m) {
  py::class_<Camera>(m, "Camera",
                     "A camera; models and parameters as COLMAP's. Pixels: the center of the "
                     "top-left one is (0.5, 0.5).")
      .def(py::init(&MakeCamera), py::arg("model"), py::arg("width"), py::arg("height"),
           py::arg("params"), py::arg("camera_id") = kInvalidCameraId,
           py::arg("has_prior_focal_length") = false)
      .def_static("create", &CameraFromFocal, py::arg("camera_id"), py::arg("model"),
                  py::arg("focal_length"), py::arg("width"), py::arg("height"),
                  "The principal point at the image center, no distortion.")
      .def_readwrite("camera_id", &Camera::camera_id)
      .def_property_readonly("model", [](const Camera& c) { return CameraModelName(c.model); })
      .def_property(
          "width", [](const Camera& c) { return c.width; },
          [](Camera& camera, int width) {
            ChangeCamera(camera, [&](Camera& c) { c.width = width; });
          },
          "Pixels.")
      .def_property(
          "height", [](const Camera& c) { return c.height; },
          [](Camera& camera, int height) {
            ChangeCamera(camera, [&](Camera& c) { c.height = height; });
          },
          "Pixels.")
      .def_property(
          "params",
          [](const Camera& c) {
            py::array_t<double> params(static_cast<py::ssize_t>(c.params.size()), c.params.data());
            params.attr("setflags")(py::arg("write") = false);  // it would change the copy alone
            return params;
          },
          [](Camera& camera, const std::vector<double>& params) {
            ChangeCamera(camera, [&](Camera& c) { c.params = params; });
          },
          "In COLMAP's order. A copy: assign all of them.")
      .def_readwrite("has_prior_focal_length", &Camera::has_prior_focal_length,
                     "The focal length is known, not guessed.")
      .def_property(
          "focal_length", &Camera::MeanFocal,
          [](Camera& camera, double focal_px) {
            if (camera.model == CameraModel::kEquirectangular) {
              throw ConfigError("focal_length", "an EQUIRECTANGULAR camera has none");
            }
            ChangeCamera(camera, [&](Camera& c) { c.SetMeanFocal(focal_px); });
          },
          "Pixels; the mean of both.")
      .def_property_readonly("focal_length_x", &Camera::FocalX)
      .def_property_readonly("focal_length_y", &Camera::FocalY)
      .def_property_readonly("principal_point", &Camera::PrincipalPoint)
      .def("calibration_matrix", &Camera::CalibrationMatrix)
      .def("img_from_cam", &ImgFromCam, py::arg("points"),
           "(n, 2) pixels of (n, 3) points in the camera's frame; NaN where there are none.")
      .def("cam_from_img", &CamFromImg, py::arg("points"),
           "(n, 2) points at depth 1 of (n, 2) pixels; NaN where there are none.")
      .def("ray_from_img", &RayFromImg, py::arg("points"),
           "(n, 3) unit bearings of (n, 2) pixels, for fields of view of any size.")
      .def("__repr__", [](const Camera& camera) { return ReprOf(camera); });
}

}  // namespace

void BindGeometry(py::module_& m) {
  BindPoses(m);
  BindCamera(m);
}

}  // namespace cairn::python
