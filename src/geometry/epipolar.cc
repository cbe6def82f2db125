#include "cairn/geometry/epipolar.h"

#include <Eigen/LU>

#include "cairn/base/check.h"
#include "cairn/math/decompositions.h"
#include "cairn/math/so3.h"

namespace cairn {

Eigen::Matrix3d EssentialFromPose(const Rigid3d& cam2_from_cam1) {
  return CrossMatrix(cam2_from_cam1.translation.normalized()) * cam2_from_cam1.RotationMatrix();
}

std::vector<Rigid3d> PosesFromEssential(const Eigen::Matrix3d& E) {
  const auto [U, V, s] = SingularValuesWithRotations(E);
  const Eigen::Matrix3d Vt = V.transpose();
  Eigen::Matrix3d W;
  W << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  const Eigen::Matrix3d R1 = U * W * Vt;
  const Eigen::Matrix3d R2 = U * W.transpose() * Vt;
  const Eigen::Vector3d t = U.col(2);
  return {Rigid3d(R1, t), Rigid3d(R1, -t), Rigid3d(R2, t), Rigid3d(R2, -t)};
}

Eigen::Matrix3d FundamentalFromEssential(const Eigen::Matrix3d& E, const Eigen::Matrix3d& K1,
                                         const Eigen::Matrix3d& K2) {
  return K2.inverse().transpose() * E * K1.inverse();
}

double SquaredSampsonError(const Eigen::Matrix3d& E, const Eigen::Vector2d& x1,
                           const Eigen::Vector2d& x2) {
  const Eigen::Vector3d line2 = E * x1.homogeneous();
  const Eigen::Vector3d line1 = E.transpose() * x2.homogeneous();
  const double c = x2.homogeneous().dot(line2);
  const double n = line2.head<2>().squaredNorm() + line1.head<2>().squaredNorm();
  return n > 0.0 ? c * c / n : 0.0;
}

double SquaredRaySampsonError(const Eigen::Matrix3d& E, const Eigen::Vector3d& ray1,
                              const Eigen::Vector3d& ray2) {
  const Eigen::Vector3d q1 = ray1.normalized(), q2 = ray2.normalized();
  const Eigen::Vector3d line2 = E * q1, line1 = E.transpose() * q2;
  const double c = q2.dot(line2);
  const double n = line2.squaredNorm() + line1.squaredNorm() - 2.0 * c * c;
  return n > 0.0 ? c * c / n : 0.0;
}

bool TriangulateRayDepths(const Rigid3d& cam2_from_cam1, const Eigen::Vector3d& ray1,
                          const Eigen::Vector3d& ray2, double* depth1, double* depth2) {
  // Least squares of depth1 * R r1 + t = depth2 * r2.
  const Eigen::Vector3d a = cam2_from_cam1.rotation * ray1;
  const Eigen::Vector3d& b = ray2;
  const Eigen::Vector3d& t = cam2_from_cam1.translation;
  const double aa = a.squaredNorm();
  const double bb = b.squaredNorm();
  const double ab = a.dot(b);
  const double det = aa * bb - ab * ab;
  if (det <= 1e-14 * aa * bb) return false;
  const double at = a.dot(t);
  const double bt = b.dot(t);
  *depth1 = (ab * bt - bb * at) / det;
  *depth2 = (aa * bt - ab * at) / det;
  return true;
}

CheiralityResult SelectPoseByCheirality(const std::vector<Rigid3d>& poses,
                                        const std::vector<Eigen::Vector2d>& x1,
                                        const std::vector<Eigen::Vector2d>& x2) {
  std::vector<Eigen::Vector3d> rays1, rays2;
  for (const Eigen::Vector2d& x : x1) rays1.emplace_back(x.homogeneous());
  for (const Eigen::Vector2d& x : x2) rays2.emplace_back(x.homogeneous());
  return SelectPoseByCheirality(poses, rays1, rays2);
}

CheiralityResult SelectPoseByCheirality(const std::vector<Rigid3d>& poses,
                                        const std::vector<Eigen::Vector3d>& rays1,
                                        const std::vector<Eigen::Vector3d>& rays2) {
  CAIRN_CHECK_EQ(rays1.size(), rays2.size());
  CheiralityResult best;
  best.num_in_front = -1;
  for (const Rigid3d& pose : poses) {
    int num_in_front = 0;
    for (size_t i = 0; i < rays1.size(); ++i) {
      double depth1, depth2;
      num_in_front += TriangulateRayDepths(pose, rays1[i], rays2[i], &depth1, &depth2) &&
                      depth1 > 0 && depth2 > 0;
    }
    if (num_in_front > best.num_in_front) best = {pose, num_in_front};
  }
  CAIRN_CHECK(!poses.empty());
  return best;
}

}  // namespace cairn
