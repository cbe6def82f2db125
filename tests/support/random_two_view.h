#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "cairn/base/rng.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/math/so3.h"
#include "cairn/solvers/affine_frame.h"
#include "cairn/solvers/one_affine_depth.h"
#include "cairn/solvers/point_correspondence.h"
#include "cairn/synthetic/poses.h"
#include "math/random_vectors.h"

namespace cairn {

// A patch of a surface seen by two pinhole cameras (normalized coordinates) in exact geometry.
struct Patch {
  Eigen::Vector3d point1;  // in camera 1
  Eigen::Vector3d normal1;
  AffineCorrespondence affine;
  LiftedCorrespondence lifted;  // depth 2 in the unit 1 / `depth_scale` of depth 1
  PointCorrespondence points() const { return {affine.frame1.point, affine.frame2.point}; }
};

struct TwoViewScene {
  Rigid3d cam2_from_cam1;  // |t| as placed
  double depth_scale = 1.0;
  std::vector<Patch> patches;
};

// d(x, y) of the projection of a point X in a camera.
inline Eigen::Matrix<double, 2, 3> ProjectionJacobian(const Eigen::Vector3d& X) {
  Eigen::Matrix<double, 2, 3> J;
  J << 1.0 / X.z(), 0.0, -X.x() / (X.z() * X.z()), 0.0, 1.0 / X.z(), -X.y() / (X.z() * X.z());
  return J;
}

// Cameras up to `max_rotation` apart (radians), a baseline of 0.3 to 1.5, points at depths 2 to 8
// with random surface normals that both cameras see from the front.
inline TwoViewScene RandomScene(Rng& rng, int num_patches, double max_rotation = 0.8) {
  TwoViewScene scene;
  for (bool complete = false; !complete;) {
    scene.patches.clear();
    const Eigen::Quaterniond R = ExpSO3(RandomOfLength(0.0, max_rotation, rng));
    scene.cam2_from_cam1 = Rigid3d(R, RandomOfLength(0.3, 1.5, rng));
    scene.depth_scale = rng.Uniform(0.3, 3.0);
    for (int attempt = 0; attempt < 100 * num_patches; ++attempt) {
      Patch patch;
      const double depth = rng.Uniform(2.0, 8.0);
      patch.point1 = depth * UniformVector({{-0.6, 0.6}, {-0.6, 0.6}}, rng).homogeneous();
      const Eigen::Vector3d X2 = scene.cam2_from_cam1 * patch.point1;
      if (X2.z() < 1.0 || X2.head<2>().cwiseAbs().maxCoeff() > X2.z()) continue;
      patch.normal1 = RandomDirection(rng);
      const Eigen::Vector3d normal2 = R * patch.normal1;
      const double cos1 = patch.normal1.dot(patch.point1.normalized());
      const double cos2 = normal2.dot(X2.normalized());
      if (std::abs(cos1) < 0.3 || std::abs(cos2) < 0.3 || cos1 * cos2 < 0.0) continue;
      // Frame axes as tangent vectors on the surface, not orthogonal in general.
      const Eigen::Vector3d e1 = patch.normal1.cross(RandomDirection(rng)).normalized();
      const Eigen::Vector3d e2 = patch.normal1.cross(e1);
      Eigen::Matrix<double, 3, 2> tangents;
      tangents << e1, rng.Uniform(-0.5, 0.5) * e1 + e2;
      tangents *= 0.02 * depth;
      const Eigen::Matrix<double, 3, 2> tangents2 = R.toRotationMatrix() * tangents;
      patch.affine.frame1 = {patch.point1.hnormalized(),
                             ProjectionJacobian(patch.point1) * tangents};
      patch.affine.frame2 = {X2.hnormalized(), ProjectionJacobian(X2) * tangents2};
      patch.lifted.frame1 = {patch.point1, tangents};
      patch.lifted.frame2 = {scene.depth_scale * X2, scene.depth_scale * tangents2};
      scene.patches.push_back(patch);
      if (static_cast<int>(scene.patches.size()) == num_patches) {
        complete = true;
        break;
      }
    }
  }
  return scene;
}

// Larger of the errors of rotation and of translation direction, radians.
inline double PoseError(const Rigid3d& a, const Rigid3d& b) {
  return std::max(AngleBetween(a.rotation, b.rotation), AngleBetween(a.translation, b.translation));
}

// The difference of two matrices known up to sign and scale, both brought to norm 1.
inline double HomogeneousError(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  const Eigen::Matrix3d na = a.normalized(), nb = b.normalized();
  return std::min((na - nb).norm(), (na + nb).norm());
}

}  // namespace cairn
