#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace cairn {

// A rigid motion b_from_a: x_b = rotation * x_a + translation. Camera frames: x right, y down, z
// forward.
struct Rigid3d {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Rigid3d() = default;
  Rigid3d(const Eigen::Quaterniond& r, const Eigen::Vector3d& t) : rotation(r), translation(t) {}
  Rigid3d(const Eigen::Matrix3d& r, const Eigen::Vector3d& t) : rotation(r), translation(t) {}

  Eigen::Matrix3d RotationMatrix() const { return rotation.toRotationMatrix(); }
  // For cam_from_world: the camera's center in the world, -R^T t.
  Eigen::Vector3d Center() const { return rotation.conjugate() * -translation; }
};

// a_from_b.
Rigid3d Inverse(const Rigid3d& b_from_a);
// c_from_a = c_from_b * b_from_a.
Rigid3d operator*(const Rigid3d& c_from_b, const Rigid3d& b_from_a);
Eigen::Vector3d operator*(const Rigid3d& b_from_a, const Eigen::Vector3d& x_a);

// A similarity b_from_a: x_b = scale * rotation * x_a + translation.
struct Sim3d {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
};

Sim3d Inverse(const Sim3d& b_from_a);
Eigen::Vector3d operator*(const Sim3d& b_from_a, const Eigen::Vector3d& x_a);
// The camera pose after the world was transformed: cam_from_new_world, up to the scale of the
// camera frame.
Rigid3d TransformCameraWorld(const Sim3d& new_from_old_world, const Rigid3d& cam_from_old_world);

// Angle of a rotation, radians, accurate near 0.
double RotationAngle(const Eigen::Quaterniond& rotation);
double AngleBetween(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b);
// Angle between two directions, radians, accurate near 0 and pi. Zero vectors: pi, or 0 if both
// are.
double AngleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b);

}  // namespace cairn
