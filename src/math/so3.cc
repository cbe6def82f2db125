#include "cairn/math/so3.h"

#include <Eigen/LU>
#include <cmath>

#include "cairn/math/decompositions.h"

namespace cairn {

Eigen::Matrix3d CrossMatrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Eigen::Quaterniond ExpSO3(const Eigen::Vector3d& axis_angle) {
  const double angle = axis_angle.norm();
  // sin(angle / 2) / angle, by its series where the quotient loses digits.
  const double k = angle < 1e-4 ? 0.5 - angle * angle / 48.0 : std::sin(0.5 * angle) / angle;
  const Eigen::Vector3d v = k * axis_angle;
  return Eigen::Quaterniond(std::cos(0.5 * angle), v.x(), v.y(), v.z()).normalized();
}

Eigen::Vector3d LogSO3(const Eigen::Quaterniond& rotation) {
  Eigen::Vector3d v = rotation.vec();
  double w = rotation.w();
  if (w < 0) {  // q and -q are the same rotation; take the one with the smaller angle.
    v = -v;
    w = -w;
  }
  const double s = v.norm();
  if (s < 1e-9) return 2.0 / w * v;
  return 2.0 * std::atan2(s, w) / s * v;
}

Eigen::Matrix3d NearestRotation(const Eigen::Matrix3d& matrix) {
  const auto [U, V, s] = SingularValues(matrix);
  const Eigen::Vector3d d(1, 1, (U * V.transpose()).determinant() < 0 ? -1 : 1);
  return U * d.asDiagonal() * V.transpose();
}

std::optional<Eigen::Quaterniond> ToRotation(const Eigen::Matrix3d& R, double max_defect) {
  constexpr double kExact = 1e-13;
  const double error = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(error < max_defect) || !(R.row(0).cross(R.row(1)).dot(R.row(2)) > 0)) return std::nullopt;
  return Eigen::Quaterniond(error < kExact ? R : NearestRotation(R)).normalized();
}

}  // namespace cairn
