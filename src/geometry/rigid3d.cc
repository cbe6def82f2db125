#include "cairn/geometry/rigid3d.h"

#include <cmath>
#include <numbers>

namespace cairn {

Rigid3d Inverse(const Rigid3d& b_from_a) {
  const Eigen::Quaterniond r = b_from_a.rotation.conjugate();
  return {r, r * -b_from_a.translation};
}

Rigid3d operator*(const Rigid3d& c_from_b, const Rigid3d& b_from_a) {
  return {(c_from_b.rotation * b_from_a.rotation).normalized(),
          c_from_b.rotation * b_from_a.translation + c_from_b.translation};
}

Eigen::Vector3d operator*(const Rigid3d& b_from_a, const Eigen::Vector3d& x_a) {
  return b_from_a.rotation * x_a + b_from_a.translation;
}

Sim3d Inverse(const Sim3d& b_from_a) {
  Sim3d a_from_b;
  a_from_b.scale = 1.0 / b_from_a.scale;
  a_from_b.rotation = b_from_a.rotation.conjugate();
  a_from_b.translation = a_from_b.rotation * b_from_a.translation * -a_from_b.scale;
  return a_from_b;
}

Eigen::Vector3d operator*(const Sim3d& b_from_a, const Eigen::Vector3d& x_a) {
  return b_from_a.scale * (b_from_a.rotation * x_a) + b_from_a.translation;
}

Rigid3d TransformCameraWorld(const Sim3d& new_from_old_world, const Rigid3d& cam_from_old_world) {
  const Eigen::Vector3d center = new_from_old_world * cam_from_old_world.Center();
  const Eigen::Quaterniond r =
      (cam_from_old_world.rotation * new_from_old_world.rotation.conjugate()).normalized();
  return {r, r * -center};
}

double RotationAngle(const Eigen::Quaterniond& rotation) {
  return 2.0 * std::atan2(rotation.vec().norm(), std::abs(rotation.w()));
}

double AngleBetween(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return RotationAngle(a.conjugate() * b);
}

double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const double norm_a = a.norm();
  const double norm_b = b.norm();
  if (norm_a == 0.0 || norm_b == 0.0) {
    return norm_a == norm_b ? 0.0 : std::numbers::pi;
  }
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace cairn
