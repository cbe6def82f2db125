#include "cairn/camera/camera.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "cairn/base/check.h"
#include "camera/camera_models.h"

namespace cairn {
namespace {

using internal::Info;
using internal::ModelInfo;

constexpr double kPi = std::numbers::pi;

// Models of which the functions here know all; those of the others are in camera_models.cc.
bool IsBasic(CameraModel model) { return static_cast<int>(model) <= 4; }

bool IsEquirectangular(CameraModel model) { return model == CameraModel::kEquirectangular; }

double Param(const double* params, int index) { return index < 0 ? 0.0 : params[index]; }

// Distorted point d = u * (1 + k1 r2 + k2 r2^2) + tangential part, its Jacobian (2x2 row-major),
// and the coefficients' derivatives dd/dk1, dd/dk2, dd/dp1, dd/dp2 (each 2).
struct Distorted {
  double d[2];
  double J[4];
  double dk1[2], dk2[2], dp1[2], dp2[2];
};

Distorted Distort(const CameraParams& params, double u, double v) {
  const ModelInfo& info = Info(params.model);
  const double k1 = Param(params.values, info.k1), k2 = Param(params.values, info.k2);
  const double p1 = Param(params.values, info.p1), p2 = Param(params.values, info.p2);
  const double uu = u * u;
  const double vv = v * v;
  const double uv = u * v;
  const double r2 = uu + vv;
  const double radial = k1 * r2 + k2 * r2 * r2;
  const double dradial = k1 + 2.0 * k2 * r2;  // d(radial)/d(r2)
  Distorted out;
  out.d[0] = u + u * radial + 2.0 * p1 * uv + p2 * (r2 + 2.0 * uu);
  out.d[1] = v + v * radial + 2.0 * p2 * uv + p1 * (r2 + 2.0 * vv);
  out.J[0] = 1.0 + radial + 2.0 * uu * dradial + 2.0 * p1 * v + 6.0 * p2 * u;
  out.J[1] = 2.0 * uv * dradial + 2.0 * p1 * u + 2.0 * p2 * v;
  out.J[2] = 2.0 * uv * dradial + 2.0 * p2 * v + 2.0 * p1 * u;
  out.J[3] = 1.0 + radial + 2.0 * vv * dradial + 2.0 * p2 * u + 6.0 * p1 * v;
  out.dk1[0] = u * r2;
  out.dk1[1] = v * r2;
  out.dk2[0] = u * r2 * r2;
  out.dk2[1] = v * r2 * r2;
  out.dp1[0] = 2.0 * uv;
  out.dp1[1] = r2 + 2.0 * vv;
  out.dp2[0] = r2 + 2.0 * uu;
  out.dp2[1] = 2.0 * uv;
  return out;
}

// Whether the distorted radius grows all the way from the center to the squared radius r2, so that
// the point there is the only one of its pixel: 1 + 3 k1 s + 5 k2 s^2 > 0 for s in [0, r2].
bool IsBeforeFold(double r2, double k1, double k2) {
  const auto slope = [&](double s) { return 1.0 + 3.0 * k1 * s + 5.0 * k2 * s * s; };
  if (slope(r2) <= 0) return false;
  const double lowest = k2 > 0 ? -0.3 * k1 / k2 : 0.0;  // where the slope is smallest
  return lowest <= 0 || lowest >= r2 || slope(lowest) > 0;
}

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

bool ProjectBasic(const CameraParams& params, const double* point, double* pixel, double* J_point,
                  double* J_params) {
  if (!(point[2] > 0.0)) return false;
  const double uv[2] = {point[0] / point[2], point[1] / point[2]};
  double J_uv[4];
  ImgFromCam(params, uv, pixel, J_point ? J_uv : nullptr, J_params);
  if (!J_point) return true;
  for (int row = 0; row < 2; ++row) {
    const double a = J_uv[2 * row] / point[2], b = J_uv[2 * row + 1] / point[2];
    J_point[3 * row] = a;
    J_point[3 * row + 1] = b;
    J_point[3 * row + 2] = -(a * uv[0] + b * uv[1]);
  }
  return true;
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

bool CameraModelIsPlanar(CameraModel model) {
  return IsBasic(model) || model == CameraModel::kFullOpenCV;
}

std::string_view CameraModelName(CameraModel model) { return Info(model).name; }
int CameraModelNumParams(CameraModel model) { return Info(model).num_params; }

bool CameraModelIsFisheye(CameraModel model) {
  switch (model) {
    case CameraModel::kOpenCVFisheye:
    case CameraModel::kSimpleRadialFisheye:
    case CameraModel::kRadialFisheye:
    case CameraModel::kThinPrismFisheye:
    case CameraModel::kRadTanThinPrismFisheye:
    case CameraModel::kSimpleFisheye:
    case CameraModel::kFisheye:
      return true;
    default:
      return false;
  }
}

Camera Camera::FromFocal(camera_t id, CameraModel model, double focal_px, int width, int height) {
  const ModelInfo& info = Info(model);
  Camera camera;
  camera.camera_id = id;
  camera.model = model;
  camera.width = width;
  camera.height = height;
  camera.params.assign(info.num_params, 0.0);
  if (IsEquirectangular(model)) {
    camera.params = {static_cast<double>(width), static_cast<double>(height)};
    return camera;
  }
  if (model == CameraModel::kFov) camera.params[4] = 0.01;
  if (model == CameraModel::kEucm) camera.params[5] = 1.0;  // beta; alpha 0 is a pinhole
  camera.params[info.fx] = focal_px;
  camera.params[info.fy] = focal_px;
  camera.params[info.cx] = 0.5 * width;
  camera.params[info.cy] = 0.5 * height;
  return camera;
}

double Camera::FocalX() const {
  return IsEquirectangular(model) ? params[0] / (2.0 * kPi) : params[Info(model).fx];
}

double Camera::FocalY() const {
  return IsEquirectangular(model) ? params[1] / kPi : params[Info(model).fy];
}

Eigen::Vector2d Camera::PrincipalPoint() const {
  if (IsEquirectangular(model)) return {0.5 * params[0], 0.5 * params[1]};
  return {params[Info(model).cx], params[Info(model).cy]};
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
  return std::max(1.0, 0.0005 * 0.5 * (camera1.DiagonalPx() + camera2.DiagonalPx()));
}

std::vector<int> Camera::FocalIndices() const {
  const ModelInfo& info = Info(model);
  if (info.fx < 0) return {};
  if (info.fx == info.fy) return {info.fx};
  return {info.fx, info.fy};
}

std::vector<int> Camera::PrincipalPointIndices() const {
  if (IsEquirectangular(model)) return {};
  return {Info(model).cx, Info(model).cy};
}

std::vector<int> Camera::DistortionIndices() const {
  std::vector<int> indices;
  if (IsEquirectangular(model)) return indices;
  for (int i = Info(model).cy + 1; i < Info(model).num_params; ++i) indices.push_back(i);
  return indices;
}

std::string Camera::Validate() const {
  if (width <= 0 || height <= 0) return "width and height must be positive";
  if (static_cast<int>(params.size()) != Info(model).num_params) {
    return std::string(CameraModelName(model)) + " takes " +
           std::to_string(Info(model).num_params) + " parameters, not " +
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

void ImgFromCam(const CameraParams& params, const double* uv, double* pixel, double* J_uv,
                double* J_params) {
  const ModelInfo& info = Info(params.model);
  if (!IsBasic(params.model)) {
    const double point[3] = {uv[0], uv[1], 1.0};
    double J_point[6];
    if (!ImgFromRay(params, point, pixel, J_uv ? J_point : nullptr, J_params)) {
      const double nan = std::numeric_limits<double>::quiet_NaN();
      std::fill_n(pixel, 2, nan);
      if (J_uv) std::fill_n(J_uv, 4, nan);
      if (J_params) std::fill_n(J_params, 2 * info.num_params, nan);
    } else if (J_uv) {
      for (int i = 0; i < 4; ++i) J_uv[i] = J_point[3 * (i / 2) + i % 2];
    }
    return;
  }
  const Distorted p = Distort(params, uv[0], uv[1]);
  const double f[2] = {params.values[info.fx], params.values[info.fy]};
  pixel[0] = f[0] * p.d[0] + params.values[info.cx];
  pixel[1] = f[1] * p.d[1] + params.values[info.cy];
  if (J_uv) {
    J_uv[0] = f[0] * p.J[0];
    J_uv[1] = f[0] * p.J[1];
    J_uv[2] = f[1] * p.J[2];
    J_uv[3] = f[1] * p.J[3];
  }
  if (J_params) {
    const int n = info.num_params;
    for (int row = 0; row < 2; ++row) {
      double* J = J_params + row * n;
      for (int i = 0; i < n; ++i) J[i] = 0.0;
      J[row == 0 ? info.fx : info.fy] = p.d[row];
      J[row == 0 ? info.cx : info.cy] = 1.0;
      if (info.k1 >= 0) J[info.k1] = f[row] * p.dk1[row];
      if (info.k2 >= 0) J[info.k2] = f[row] * p.dk2[row];
      if (info.p1 >= 0) J[info.p1] = f[row] * p.dp1[row];
      if (info.p2 >= 0) J[info.p2] = f[row] * p.dp2[row];
    }
  }
}

bool ImgFromRay(const CameraParams& params, const double* point, double* pixel, double* J_point,
                double* J_params) {
  if (IsBasic(params.model)) return ProjectBasic(params, point, pixel, J_point, J_params);
  if (IsEquirectangular(params.model)) {
    return ProjectEquirectangular(params.values, point, pixel, J_point, J_params);
  }
  const ModelInfo& info = Info(params.model);
  internal::PlanePoint plane;
  const int first_extra = info.cy + 1;
  if (!internal::Project(params.model, params.values + first_extra, point, J_params != nullptr,
                         &plane)) {
    return false;
  }
  const double f[2] = {params.values[info.fx], params.values[info.fy]};
  pixel[0] = f[0] * plane.d[0] + params.values[info.cx];
  pixel[1] = f[1] * plane.d[1] + params.values[info.cy];
  for (int row = 0; row < 2; ++row) {
    if (J_point) {
      for (int k = 0; k < 3; ++k) J_point[3 * row + k] = f[row] * plane.J[3 * row + k];
    }
    if (!J_params) continue;
    double* J = J_params + row * info.num_params;
    std::fill_n(J, info.num_params, 0.0);
    J[row == 0 ? info.fx : info.fy] = plane.d[row];
    J[row == 0 ? info.cx : info.cy] = 1.0;
    for (int k = first_extra; k < info.num_params; ++k) {
      J[k] = f[row] * plane.extra[row][k - first_extra];
    }
  }
  return true;
}

std::optional<Eigen::Vector2d> Camera::ImgFromRay(const Eigen::Vector3d& point,
                                                  Eigen::Matrix<double, 2, 3>* J) const {
  CAIRN_DCHECK(static_cast<int>(params.size()) == Info(model).num_params);
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
  if (IsBasic(model)) {
    const auto uv = CamFromImg(pixel);
    if (!uv) return std::nullopt;
    return uv->homogeneous().normalized();
  }
  if (!pixel.allFinite()) return std::nullopt;
  if (IsEquirectangular(model)) return UnprojectEquirectangular(params.data(), pixel);
  const ModelInfo& info = Info(model);
  const Eigen::Vector2d d((pixel.x() - params[info.cx]) / params[info.fx],
                          (pixel.y() - params[info.cy]) / params[info.fy]);
  const auto ray = internal::Unproject(model, params.data() + info.cy + 1, d);
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

Eigen::Vector2d Camera::ImgFromCam(const Eigen::Vector2d& uv, Eigen::Matrix2d* J_uv) const {
  return ImgFromCam(uv, J_uv, nullptr);
}

Eigen::Vector2d Camera::ImgFromCam(const Eigen::Vector2d& uv, Eigen::Matrix2d* J_uv,
                                   double* J_params) const {
  CAIRN_DCHECK(static_cast<int>(params.size()) == Info(model).num_params);
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 2, Eigen::RowMajor> J;
  cairn::ImgFromCam({model, params.data()}, uv.data(), pixel.data(), J.data(), J_params);
  if (J_uv) *J_uv = J;
  return pixel;
}

std::optional<Eigen::Vector2d> Camera::CamFromImg(const Eigen::Vector2d& pixel,
                                                  Eigen::Matrix2d* J) const {
  const ModelInfo& info = Info(model);
  if (!IsBasic(model)) {
    const auto ray = RayFromImg(pixel);
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
  const Eigen::Vector2d distorted((pixel.x() - params[info.cx]) / params[info.fx],
                                  (pixel.y() - params[info.cy]) / params[info.fy]);
  Eigen::Vector2d uv = distorted;
  Eigen::Matrix2d J_uv = Eigen::Matrix2d::Identity();
  if (info.k1 >= 0) {
    bool converged = false;
    for (int iteration = 0; iteration < 50; ++iteration) {
      const Distorted p = Distort({model, params.data()}, uv.x(), uv.y());
      J_uv << p.J[0], p.J[1], p.J[2], p.J[3];
      // Where the distortion folds over, the model has no inverse.
      if (!(J_uv.determinant() > 1e-3)) return std::nullopt;
      if (converged) break;
      const Eigen::Vector2d step = J_uv.inverse() * (distorted - Eigen::Vector2d(p.d[0], p.d[1]));
      uv += step;
      converged = step.squaredNorm() < 1e-26 * (1.0 + uv.squaredNorm());
      if (iteration == 49 && step.squaredNorm() > 1e-18) return std::nullopt;
    }
    // Newton's method may have stepped across the fold, to a branch that shows nothing.
    if (!IsBeforeFold(uv.squaredNorm(), Param(params.data(), info.k1),
                      Param(params.data(), info.k2))) {
      return std::nullopt;
    }
  }
  if (J) {
    const Eigen::Matrix2d J_pixel =
        Eigen::Vector2d(params[info.fx], params[info.fy]).asDiagonal() * J_uv;
    *J = J_pixel.inverse();
  }
  return uv;
}

}  // namespace cairn
