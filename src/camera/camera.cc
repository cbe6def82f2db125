#include "cairn/camera/camera.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <array>
#include <limits>
#include <numbers>
#include <numeric>

#include "cairn/base/check.h"
#include "camera/camera_models.h"

namespace cairn {
namespace {

using internal::Family;
using internal::Info;
using internal::ModelInfo;

constexpr double kPi = std::numbers::pi;

// Longitude runs over the width, latitude over the height; the center looks along z. The seam
// behind is where the pixel jumps.
bool ProjectEquirectangular(const double* params, const double* x, double* pixel, double* J_point,
                            double* J_params) {
  const double rho2 = x[0] * x[0] + x[2] * x[2], rho = std::sqrt(rho2);
  const double n2 = rho2 + x[1] * x[1];
  if (!(rho > 1e-12 * std::abs(x[1]))) return false;  // at a pole, any longitude will do
  const double across = std::atan2(x[0], x[2]) / (2.0 * kPi) + 0.5;
  const double down = std::atan2(x[1], rho) / kPi + 0.5;
  pixel[0] = params[0] * across;
  pixel[1] = params[1] * down;
  if (J_point) {
    const double a = params[0] / (2.0 * kPi * rho2), b = params[1] / (kPi * n2);
    J_point[0] = a * x[2];
    J_point[1] = 0.0;
    J_point[2] = -a * x[0];
    J_point[3] = -b * x[1] * x[0] / rho;
    J_point[4] = b * rho;
    J_point[5] = -b * x[1] * x[2] / rho;
  }
  if (J_params) {
    J_params[0] = across;
    J_params[1] = J_params[2] = 0.0;
    J_params[3] = down;
  }
  return true;
}

Eigen::Vector3d UnprojectEquirectangular(const double* params, const Eigen::Vector2d& pixel) {
  const double across = 2.0 * kPi * (pixel.x() / params[0] - 0.5);
  const double down = kPi * (pixel.y() / params[1] - 0.5);
  return {std::cos(down) * std::sin(across), std::sin(down), std::cos(down) * std::cos(across)};
}

// Any direction of a pixel, not normalized.
std::optional<Eigen::Vector3d> Unproject(const Camera& camera, const Eigen::Vector2d& pixel) {
  if (!pixel.allFinite()) return std::nullopt;
  const ModelInfo& info = Info(camera.model);
  const double* params = camera.params.data();
  if (info.family == Family::kEquirectangular) return UnprojectEquirectangular(params, pixel);
  const Eigen::Vector2d d((pixel.x() - params[info.cx()]) / params[info.fx()],
                          (pixel.y() - params[info.cy()]) / params[info.fy()]);
  return internal::Unproject(info, params + info.first_extra(), d);
}

}  // namespace

std::optional<CameraModel> CameraModelFromName(std::string_view name) {
  for (int id = 0; id < kNumCameraModels; ++id) {
    const auto model = static_cast<CameraModel>(id);
    if (Info(model).name == name) return model;
  }
  return std::nullopt;
}

std::optional<CameraModel> CameraModelFromId(int id) {
  if (id < 0 || id >= kNumCameraModels) return std::nullopt;
  return static_cast<CameraModel>(id);
}

std::span<const NamedValue<CameraModel>> NamedCameraModels() {
  static const auto models = [] {
    std::array<NamedValue<CameraModel>, kNumCameraModels> named;
    for (int id = 0; id < kNumCameraModels; ++id) {
      const auto model = static_cast<CameraModel>(id);
      named[id] = {model, Info(model).name};
    }
    return named;
  }();
  return models;
}

bool CameraModelIsPlanar(CameraModel model) { return Info(model).family == Family::kPlanar; }
bool CameraModelIsFisheye(CameraModel model) { return Info(model).family == Family::kFisheye; }

std::string_view CameraModelName(CameraModel model) { return Info(model).name; }
int CameraModelNumParams(CameraModel model) { return Info(model).num_params(); }

Camera Camera::FromFocal(camera_t id, CameraModel model, double focal_px, int width, int height) {
  Camera camera;
  camera.camera_id = id;
  camera.model = model;
  camera.width = width;
  camera.height = height;
  const ModelInfo& info = Info(model);
  if (info.family == Family::kEquirectangular) {
    camera.params = {static_cast<double>(width), static_cast<double>(height)};
    return camera;
  }
  camera.params.assign(info.num_params(), 0.0);
  if (info.family == Family::kFov) camera.params[4] = 0.01;
  if (info.family == Family::kEucm) camera.params[5] = 1.0;  // beta; alpha 0 is a pinhole
  camera.params[info.fx()] = camera.params[info.fy()] = focal_px;
  camera.params[info.cx()] = 0.5 * width;
  camera.params[info.cy()] = 0.5 * height;
  return camera;
}

double Camera::FocalX() const {
  const ModelInfo& info = Info(model);
  return info.num_focals == 0 ? params[0] / (2.0 * kPi) : params[info.fx()];
}

double Camera::FocalY() const {
  const ModelInfo& info = Info(model);
  return info.num_focals == 0 ? params[1] / kPi : params[info.fy()];
}

Eigen::Vector2d Camera::PrincipalPoint() const {
  const ModelInfo& info = Info(model);
  if (info.num_focals == 0) return {0.5 * params[0], 0.5 * params[1]};
  return {params[info.cx()], params[info.cy()]};
}

Eigen::Matrix3d Camera::CalibrationMatrix() const {
  Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
  K(0, 0) = FocalX();
  K(1, 1) = FocalY();
  K.block<2, 1>(0, 2) = PrincipalPoint();
  return K;
}

void Camera::SetMeanFocal(double focal_px) {
  const double factor = focal_px / MeanFocal();
  for (const int i : FocalIndices()) params[i] *= factor;
}

double Camera::DiagonalPx() const { return std::hypot(width, height); }

double DefaultMaxErrorPx(const Camera& camera1, const Camera& camera2) {
  return std::max(1.0, 0.001 * 0.5 * (camera1.DiagonalPx() + camera2.DiagonalPx()));
}

double DefaultSigmaPx(const Camera& camera1, const Camera& camera2) {
  return std::max(1.0, 0.5 * DefaultMaxErrorPx(camera1, camera2));
}

std::vector<int> Camera::FocalIndices() const {
  std::vector<int> indices(Info(model).num_focals);
  std::iota(indices.begin(), indices.end(), 0);
  return indices;
}

std::vector<int> Camera::PrincipalPointIndices() const {
  if (Info(model).num_focals == 0) return {};
  return {Info(model).cx(), Info(model).cy()};
}

std::vector<int> Camera::DistortionIndices() const {
  std::vector<int> indices(Info(model).num_extra);
  std::iota(indices.begin(), indices.end(), Info(model).first_extra());
  return indices;
}

std::string Camera::Validate() const {
  if (!CameraModelFromId(static_cast<int>(model))) return "the model is none that is known";
  if (width <= 0 || height <= 0) return "width and height must be positive";
  if (static_cast<int>(params.size()) != Info(model).num_params()) {
    return std::string(CameraModelName(model)) + " takes " +
           std::to_string(Info(model).num_params()) + " parameters, not " +
           std::to_string(params.size());
  }
  for (const double p : params) {
    if (!std::isfinite(p)) return "a parameter is not finite";
  }
  if (FocalX() <= 0 || FocalY() <= 0) return "the focal length must be positive";
  // So that it and its square, and their inverses, are numbers in single precision.
  for (const double focal : {FocalX(), FocalY()}) {
    if (focal < 1e-15 || focal > 1e15) return "the focal length is no length in pixels";
  }
  if (model == CameraModel::kEucm && !(params[5] > 0)) return "beta must be positive";
  return "";
}

bool ImgFromRay(const CameraParams& params, const double* point, double* pixel, double* J_point,
                double* J_params) {
  const ModelInfo& info = Info(params.model);
  if (info.family == Family::kEquirectangular) {
    return ProjectEquirectangular(params.values, point, pixel, J_point, J_params);
  }
  const double f[2] = {params.values[info.fx()], params.values[info.fy()]};
  const int n = info.num_params();
  internal::ExtraRows J_extra;
  if (J_params) {
    std::fill_n(J_params, 2 * n, 0.0);
    J_extra = {J_params + info.first_extra(), J_params + n + info.first_extra()};
  }
  internal::PlanePoint plane;
  if (!internal::Project(info, {f, params.values + info.first_extra()}, point,
                         J_params ? &J_extra : nullptr, &plane)) {
    return false;
  }
  pixel[0] = f[0] * plane.d[0] + params.values[info.cx()];
  pixel[1] = f[1] * plane.d[1] + params.values[info.cy()];
  if (J_point) std::copy_n(plane.J, 6, J_point);
  if (!J_params) return true;
  for (int k = 0; k < info.num_extra; ++k) {
    for (int row = 0; row < 2; ++row) J_extra[row][k] *= f[row];
  }
  J_params[info.fx()] = plane.d[0];
  J_params[info.cx()] = 1.0;
  J_params[n + info.fy()] = plane.d[1];
  J_params[n + info.cy()] = 1.0;
  return true;
}

std::optional<Eigen::Vector2d> Camera::ImgFromRay(const Eigen::Vector3d& point,
                                                  Eigen::Matrix<double, 2, 3>* J) const {
  CAIRN_DCHECK(static_cast<int>(params.size()) == Info(model).num_params());
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> J_point;
  if (!cairn::ImgFromRay({model, params.data()}, point.data(), pixel.data(),
                         J ? J_point.data() : nullptr, nullptr)) {
    return std::nullopt;
  }
  if (J) *J = J_point;
  return pixel;
}

std::optional<Eigen::Vector3d> Camera::RayFromImg(const Eigen::Vector2d& pixel) const {
  const auto ray = Unproject(*this, pixel);
  if (!ray) return std::nullopt;
  return ray->normalized();
}

double Camera::RadiansPerPx(const Eigen::Vector3d& point) const {
  Eigen::Matrix<double, 2, 3> J;
  const Eigen::Vector3d ray = point.normalized();
  if (!ImgFromRay(ray, &J)) return std::numeric_limits<double>::infinity();
  // Both rows are orthogonal to the ray: their cross product is the area that unit solid angle has.
  const Eigen::Vector3d row0 = J.row(0), row1 = J.row(1);
  return 1.0 / std::sqrt(row0.cross(row1).norm());
}

Eigen::Vector2d Camera::ImgFromCam(const Eigen::Vector2d& uv, Eigen::Matrix2d* J_uv,
                                   double* J_params) const {
  CAIRN_DCHECK(static_cast<int>(params.size()) == Info(model).num_params());
  const Eigen::Vector3d point = uv.homogeneous();
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> J;
  if (!cairn::ImgFromRay({model, params.data()}, point.data(), pixel.data(), J.data(), J_params)) {
    const double nan = std::numeric_limits<double>::quiet_NaN();
    pixel.setConstant(nan);
    J.setConstant(nan);
    if (J_params) std::fill_n(J_params, 2 * params.size(), nan);
  }
  if (J_uv) *J_uv = J.leftCols<2>();
  return pixel;
}

std::optional<Eigen::Vector2d> Camera::CamFromImg(const Eigen::Vector2d& pixel,
                                                  Eigen::Matrix2d* J) const {
  const auto ray = Unproject(*this, pixel);
  if (!ray || !(ray->z() > 0.0)) return std::nullopt;
  const Eigen::Vector2d uv = ray->hnormalized();
  if (J) {
    Eigen::Matrix2d J_uv;
    ImgFromCam(uv, &J_uv);
    if (!J_uv.allFinite()) return std::nullopt;
    *J = J_uv.inverse();
  }
  return uv;
}

}  // namespace cairn
