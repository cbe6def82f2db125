#include "camera/camera_models.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace cairn::internal {
namespace {

constexpr double kPi = std::numbers::pi;

constexpr Polynomial kOneRadial{.num_radial = 1, .radial = {0}};
constexpr Polynomial kTwoRadial{.num_radial = 2, .radial = {0, 1}};
constexpr Polynomial kFourRadial{.num_radial = 4, .radial = {0, 1, 2, 3}};
constexpr Polynomial kOpenCV{.num_radial = 2, .radial = {0, 1}, .p1 = 2, .p2 = 3};
constexpr Polynomial kFullOpenCV{.num_radial = 3,
                                 .radial = {0, 1, 4},
                                 .num_denominator = 3,
                                 .denominator = {5, 6, 7},
                                 .p1 = 2,
                                 .p2 = 3};
constexpr Polynomial kThinPrism{
    .num_radial = 4, .radial = {0, 1, 4, 5}, .p1 = 2, .p2 = 3, .sx = 6, .sy = 7};
// Here p0 belongs to the first coordinate.
constexpr Polynomial kRadTan{.num_radial = 6,
                             .radial = {0, 1, 2, 3, 4, 5},
                             .p1 = 7,
                             .p2 = 6,
                             .sx = 8,
                             .sy = 10,
                             .sx2 = 9,
                             .sy2 = 11,
                             .is_two_steps = true};

// By COLMAP's ids.
constexpr ModelInfo kModels[kNumCameraModels] = {
    {"SIMPLE_PINHOLE", Family::kPlanar, 1, 0},
    {"PINHOLE", Family::kPlanar, 2, 0},
    {"SIMPLE_RADIAL", Family::kPlanar, 1, 1, kOneRadial},
    {"RADIAL", Family::kPlanar, 1, 2, kTwoRadial},
    {"OPENCV", Family::kPlanar, 2, 4, kOpenCV},
    {"OPENCV_FISHEYE", Family::kFisheye, 2, 4, kFourRadial},
    {"FULL_OPENCV", Family::kPlanar, 2, 8, kFullOpenCV},
    {"FOV", Family::kFov, 2, 1},
    {"SIMPLE_RADIAL_FISHEYE", Family::kFisheye, 1, 1, kOneRadial},
    {"RADIAL_FISHEYE", Family::kFisheye, 1, 2, kTwoRadial},
    {"THIN_PRISM_FISHEYE", Family::kFisheye, 2, 8, kThinPrism},
    {"RAD_TAN_THIN_PRISM_FISHEYE", Family::kFisheye, 2, 12, kRadTan},
    {"SIMPLE_DIVISION", Family::kDivision, 1, 1},
    {"DIVISION", Family::kDivision, 2, 1},
    {"SIMPLE_FISHEYE", Family::kFisheye, 1, 0},
    {"FISHEYE", Family::kFisheye, 2, 0},
    {"EUCM", Family::kEucm, 2, 2},
    {"EQUIRECTANGULAR", Family::kEquirectangular, 0, 0},
};

// Below this tangent, quotients by it are taken from their series: the terms left out and the
// cancellation in the quotients are both about 1e-12 there.
constexpr double kSmallTangent = 1e-3;

// q = s(rho, z) (x, y), with dq_i/dx_j = s delta_ij + g x_i x_j and dq_i/dz = h x_i.
struct Axial {
  double s, g, h;
};

void FromAxial(const Axial& a, const double* f, const double* x, PlanePoint* out) {
  for (int i = 0; i < 2; ++i) {
    out->d[i] = a.s * x[i];
    for (int j = 0; j < 2; ++j) {
      out->J[3 * i + j] = f[i] * ((i == j ? a.s : 0.0) + a.g * x[i] * x[j]);
    }
    out->J[3 * i + 2] = f[i] * a.h * x[i];
  }
}

// atan2(T rho, z) / rho (x, y): equidistant for T = 1. False on the axis behind the camera.
bool AngleAxial(const double* x, double T, Axial* out) {
  const double z = x[2], rho2 = x[0] * x[0] + x[1] * x[1], n = T * T * rho2 + z * z;
  const double rho = std::sqrt(rho2), t = T * rho / z;
  if (z > 0.0 && std::abs(t) < kSmallTangent) {
    const double t2 = t * t;
    out->s = T / z * (1.0 - t2 / 3.0 + t2 * t2 / 5.0);
    out->g = T * T * T / (z * z * z) * (-2.0 / 3.0 + 0.8 * t2);
  } else {
    if (!(rho > kSmallTangent * 1e-6 * std::abs(z))) return false;
    out->s = std::atan2(T * rho, z) / rho;
    out->g = (T * z / n - out->s) / rho2;
  }
  out->h = -T / n;
  return true;
}

bool ProjectFisheye(const Polynomial& p, Lens lens, const double* x, const ExtraRows* J_extra,
                    PlanePoint* out) {
  constexpr double kUnit[2] = {1.0, 1.0};
  Axial axial;
  if (!AngleAxial(x, 1.0, &axial)) return false;
  FromAxial(axial, kUnit, x, out);
  const PlaneMap map = Distort(p, lens.extra, out->d, J_extra);
  for (int j = 0; j < 3; ++j) {
    const double a = out->J[j], b = out->J[3 + j];
    for (int i = 0; i < 2; ++i) {
      out->J[3 * i + j] = lens.f[i] * (map.J[2 * i] * a + map.J[2 * i + 1] * b);
    }
  }
  std::copy_n(map.d, 2, out->d);
  return true;
}

// Below this, FOV is taken from its series in omega: what is left out is omega^4.
constexpr double kSmallOmega = 1e-4;

// Devernay and Faugeras, "Straight lines have to be straight", 2001: the distorted radius is
// atan(2 tan(omega / 2) r) / omega. It goes on beside and behind the camera.
bool ProjectFov(Lens lens, const double* x, const ExtraRows* J_extra, PlanePoint* out) {
  const double omega = lens.extra[0], z = x[2], rho2 = x[0] * x[0] + x[1] * x[1];
  Axial axial;
  double ds;  // d(s)/d(omega)
  if (std::abs(omega) < kSmallOmega) {
    if (!(z > 0.0)) return false;
    const double w2 = omega * omega, t2 = rho2 / (z * z);
    axial.s = (1.0 + w2 * (1.0 / 12.0 - t2 / 3.0)) / z;
    axial.g = -2.0 / 3.0 * w2 / (z * z * z);
    axial.h = -(1.0 + w2 * (1.0 / 12.0 - t2)) / (z * z);
    ds = omega * (1.0 / 6.0 - 2.0 / 3.0 * t2) / z;
  } else {
    const double T = 2.0 * std::tan(0.5 * omega);
    if (!AngleAxial(x, T, &axial)) return false;
    const double angle_over_rho = axial.s;
    axial = {axial.s / omega, axial.g / omega, axial.h / omega};
    ds = (z * (1.0 + 0.25 * T * T) / (T * T * rho2 + z * z) - angle_over_rho / omega) / omega;
  }
  FromAxial(axial, lens.f, x, out);
  if (J_extra) {
    (*J_extra)[0][0] = ds * x[0];
    (*J_extra)[1][0] = ds * x[1];
  }
  return true;
}

// Fitzgibbon, "Simultaneous linear estimation of multiple view geometry and lens distortion", 2001:
// the ray of a point d of the plane is (d, 1 + k |d|^2).
bool ProjectDivision(Lens lens, const double* x, const ExtraRows* J_extra, PlanePoint* out) {
  const double k = lens.extra[0], z = x[2], rho2 = x[0] * x[0] + x[1] * x[1];
  const double discriminant = z * z - 4.0 * k * rho2;
  if (!(discriminant > 0.0)) return false;
  const double root = std::sqrt(discriminant), sum = z + root;
  if (!(sum > 1e-12 * root)) return false;  // behind the camera, or on the axis there
  const double s = 2.0 / sum;
  // ds = -2 / sum^2 d(sum).
  const double factor = -2.0 / (sum * sum);
  FromAxial({s, -4.0 * k * factor / root, factor * (1.0 + z / root)}, lens.f, x, out);
  if (J_extra) {
    const double ds = -2.0 * rho2 * factor / root;
    (*J_extra)[0][0] = ds * x[0];
    (*J_extra)[1][0] = ds * x[1];
  }
  return true;
}

// Khomutenko, Garcia and Martinet, "An enhanced unified camera model", 2016.
bool ProjectEucm(Lens lens, const double* x, const ExtraRows* J_extra, PlanePoint* out) {
  const double alpha = lens.extra[0], beta = lens.extra[1], z = x[2],
               rho2 = x[0] * x[0] + x[1] * x[1];
  const double squared = beta * rho2 + z * z;
  if (!(squared > 0.0)) return false;
  const double d = std::sqrt(squared);
  const double m = alpha * d + (1.0 - alpha) * z;
  // Beyond this two rays have one pixel, or none.
  const double w = alpha <= 0.5 ? alpha / (1.0 - alpha) : (1.0 - alpha) / alpha;
  if (!(z > -w * d) || !(m > 1e-12 * d)) return false;
  const double s = 1.0 / m;
  const double factor = -s * s;  // ds = factor dm
  FromAxial({s, factor * alpha * beta / d, factor * (alpha * z / d + 1.0 - alpha)}, lens.f, x, out);
  if (J_extra) {
    const double by_alpha = factor * (d - z), by_beta = factor * alpha * 0.5 * rho2 / d;
    for (int i = 0; i < 2; ++i) {
      (*J_extra)[i][0] = by_alpha * x[i];
      (*J_extra)[i][1] = by_beta * x[i];
    }
  }
  return true;
}

bool ProjectPlanar(const Polynomial& p, Lens lens, const double* x, const ExtraRows* J_extra,
                   PlanePoint* out) {
  if (!(x[2] > 0.0)) return false;
  const double q[2] = {x[0] / x[2], x[1] / x[2]};
  const PlaneMap map = Distort(p, lens.extra, q, J_extra);
  for (int i = 0; i < 2; ++i) {
    const double a = lens.f[i] * map.J[2 * i] / x[2], b = lens.f[i] * map.J[2 * i + 1] / x[2];
    out->d[i] = map.d[i];
    out->J[3 * i] = a;
    out->J[3 * i + 1] = b;
    out->J[3 * i + 2] = -(a * q[0] + b * q[1]);
  }
  return true;
}

// sin(angle) / angle for angles up to pi.
double Sinc(double angle) {
  return angle < 1e-4 ? 1.0 - angle * angle / 6.0 : std::sin(angle) / angle;
}

std::optional<Eigen::Vector3d> UnprojectFov(const double* extra, const Eigen::Vector2d& d) {
  const double omega = std::abs(extra[0]), r = d.norm();
  if (omega < kSmallOmega) {
    const double w2 = omega * omega;
    const Eigen::Vector2d uv = d * (1.0 - w2 / 12.0 + w2 * r * r / 3.0);
    return Eigen::Vector3d(uv.x(), uv.y(), 1.0);
  }
  const double angle = r * omega;
  if (!(angle < kPi)) return std::nullopt;
  const double s = omega * Sinc(angle) / (2.0 * std::tan(0.5 * omega));
  return Eigen::Vector3d(s * d.x(), s * d.y(), std::cos(angle));
}

std::optional<Eigen::Vector3d> UnprojectDivision(const double* extra, const Eigen::Vector2d& d) {
  const double t = extra[0] * d.squaredNorm();
  // From 1 on the angle off axis gets smaller again.
  if (!(t < 1.0)) return std::nullopt;
  return Eigen::Vector3d(d.x(), d.y(), 1.0 + t);
}

std::optional<Eigen::Vector3d> UnprojectEucm(const double* extra, const Eigen::Vector2d& d) {
  const double alpha = extra[0], beta = extra[1], r2 = d.squaredNorm();
  const double radicand = 1.0 - (2.0 * alpha - 1.0) * beta * r2;
  if (!(radicand > 0.0)) return std::nullopt;
  const double denominator = alpha * std::sqrt(radicand) + 1.0 - alpha;
  if (!(denominator > 0.0)) return std::nullopt;
  return Eigen::Vector3d(d.x(), d.y(), (1.0 - alpha * alpha * beta * r2) / denominator);
}

}  // namespace

const ModelInfo& Info(CameraModel model) { return kModels[static_cast<int>(model)]; }

bool Project(const ModelInfo& info, Lens lens, const double* point, const ExtraRows* J_extra,
             PlanePoint* out) {
  switch (info.family) {
    case Family::kPlanar:
      return ProjectPlanar(info.polynomial, lens, point, J_extra, out);
    case Family::kFisheye:
      return ProjectFisheye(info.polynomial, lens, point, J_extra, out);
    case Family::kFov:
      return ProjectFov(lens, point, J_extra, out);
    case Family::kDivision:
      return ProjectDivision(lens, point, J_extra, out);
    case Family::kEucm:
      return ProjectEucm(lens, point, J_extra, out);
    case Family::kEquirectangular:
      break;
  }
  return false;
}

std::optional<Eigen::Vector3d> Unproject(const ModelInfo& info, const double* extra,
                                         const Eigen::Vector2d& d) {
  switch (info.family) {
    case Family::kPlanar: {
      const auto q = Undistort(info.polynomial, extra, d, std::numeric_limits<double>::infinity());
      if (!q) return std::nullopt;
      return Eigen::Vector3d(q->x(), q->y(), 1.0);
    }
    case Family::kFisheye: {
      const auto q = Undistort(info.polynomial, extra, d, kPi);
      if (!q) return std::nullopt;
      const double angle = q->norm(), s = Sinc(angle);
      return Eigen::Vector3d(s * q->x(), s * q->y(), std::cos(angle));
    }
    case Family::kFov:
      return UnprojectFov(extra, d);
    case Family::kDivision:
      return UnprojectDivision(extra, d);
    case Family::kEucm:
      return UnprojectEucm(extra, d);
    case Family::kEquirectangular:
      break;
  }
  return std::nullopt;
}

}  // namespace cairn::internal
