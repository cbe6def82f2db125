#include "cairn/camera/camera.h"

#include <Eigen/LU>
#include <array>
#include <cmath>

#include "cairn/base/check.h"

namespace cairn {
namespace {

// Where each model keeps what. -1: the model has no such parameter.
struct ModelInfo {
  CameraModel model;
  std::string_view name;
  int num_params;
  int fx, fy, cx, cy, k1, k2, p1, p2;
};

constexpr std::array<ModelInfo, 5> kModels = {{
    {CameraModel::kSimplePinhole, "SIMPLE_PINHOLE", 3, 0, 0, 1, 2, -1, -1, -1, -1},
    {CameraModel::kPinhole, "PINHOLE", 4, 0, 1, 2, 3, -1, -1, -1, -1},
    {CameraModel::kSimpleRadial, "SIMPLE_RADIAL", 4, 0, 0, 1, 2, 3, -1, -1, -1},
    {CameraModel::kRadial, "RADIAL", 5, 0, 0, 1, 2, 3, 4, -1, -1},
    {CameraModel::kOpenCV, "OPENCV", 8, 0, 1, 2, 3, 4, 5, 6, 7},
}};

const ModelInfo& Info(CameraModel model) { return kModels[static_cast<int>(model)]; }

// Distorted point d = u * (1 + k1 r2 + k2 r2^2) + tangential part, its Jacobian (2x2 row-major),
// and the coefficients' derivatives dd/dk1, dd/dk2, dd/dp1, dd/dp2 (each 2).
struct Distorted {
  double d[2];
  double J[4];
  double dk1[2], dk2[2], dp1[2], dp2[2];
};

Distorted Distort(double u, double v, double k1, double k2, double p1, double p2) {
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

double Param(const double* params, int index) { return index < 0 ? 0.0 : params[index]; }

}  // namespace

std::optional<CameraModel> CameraModelFromName(std::string_view name) {
  for (const ModelInfo& info : kModels) {
    if (info.name == name) return info.model;
  }
  return std::nullopt;
}

std::optional<CameraModel> CameraModelFromId(int id) {
  if (id < 0 || id >= static_cast<int>(kModels.size())) return std::nullopt;
  return static_cast<CameraModel>(id);
}

std::string_view CameraModelName(CameraModel model) { return Info(model).name; }
int CameraModelNumParams(CameraModel model) { return Info(model).num_params; }

Camera Camera::FromFocal(camera_t id, CameraModel model, double focal_px, int width, int height) {
  const ModelInfo& info = Info(model);
  Camera camera;
  camera.camera_id = id;
  camera.model = model;
  camera.width = width;
  camera.height = height;
  camera.params.assign(info.num_params, 0.0);
  camera.params[info.fx] = focal_px;
  camera.params[info.fy] = focal_px;
  camera.params[info.cx] = 0.5 * width;
  camera.params[info.cy] = 0.5 * height;
  return camera;
}

double Camera::FocalX() const { return params[Info(model).fx]; }
double Camera::FocalY() const { return params[Info(model).fy]; }

Eigen::Vector2d Camera::PrincipalPoint() const {
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

std::vector<int> Camera::FocalIndices() const {
  const ModelInfo& info = Info(model);
  if (info.fx == info.fy) return {info.fx};
  return {info.fx, info.fy};
}

std::vector<int> Camera::PrincipalPointIndices() const { return {Info(model).cx, Info(model).cy}; }

std::vector<int> Camera::DistortionIndices() const {
  std::vector<int> indices;
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
  return "";
}

void ImgFromCam(CameraModel model, const double* params, const double* uv, double* pixel,
                double* J_uv, double* J_params) {
  const ModelInfo& info = Info(model);
  const Distorted p = Distort(uv[0], uv[1], Param(params, info.k1), Param(params, info.k2),
                              Param(params, info.p1), Param(params, info.p2));
  const double f[2] = {params[info.fx], params[info.fy]};
  pixel[0] = f[0] * p.d[0] + params[info.cx];
  pixel[1] = f[1] * p.d[1] + params[info.cy];
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

Eigen::Vector2d Camera::ImgFromCam(const Eigen::Vector2d& uv, Eigen::Matrix2d* J_uv) const {
  return ImgFromCam(uv, J_uv, nullptr);
}

Eigen::Vector2d Camera::ImgFromCam(const Eigen::Vector2d& uv, Eigen::Matrix2d* J_uv,
                                   double* J_params) const {
  CAIRN_DCHECK(static_cast<int>(params.size()) == Info(model).num_params);
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, 2, Eigen::RowMajor> J;
  cairn::ImgFromCam(model, params.data(), uv.data(), pixel.data(), J.data(), J_params);
  if (J_uv) *J_uv = J;
  return pixel;
}

std::optional<Eigen::Vector2d> Camera::CamFromImg(const Eigen::Vector2d& pixel,
                                                  Eigen::Matrix2d* J) const {
  const ModelInfo& info = Info(model);
  const Eigen::Vector2d distorted((pixel.x() - params[info.cx]) / params[info.fx],
                                  (pixel.y() - params[info.cy]) / params[info.fy]);
  Eigen::Vector2d uv = distorted;
  Eigen::Matrix2d J_uv = Eigen::Matrix2d::Identity();
  if (info.k1 >= 0) {
    bool converged = false;
    for (int iteration = 0; iteration < 50; ++iteration) {
      const Distorted p =
          Distort(uv.x(), uv.y(), Param(params.data(), info.k1), Param(params.data(), info.k2),
                  Param(params.data(), info.p1), Param(params.data(), info.p2));
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
