#include "cairn/geometry/epipolar.h"

#include <Eigen/LU>
#include <cmath>

#include "cairn/base/check.h"
#include "cairn/math/decompositions.h"
#include "cairn/math/so3.h"

namespace cairn {

Eigen::Matrix3d EssentialFromPose(const Rigid3d& cam2_from_cam1) {
  return CrossMatrix(cam2_from_cam1.translation.normalized()) * cam2_from_cam1.RotationMatrix();
}

Eigen::Matrix3d NearestEssential(const Eigen::Matrix3d& matrix) {
  const auto [U, V, s] = SingularValues(matrix);
  return U * Eigen::Vector3d(1.0, 1.0, 0.0).asDiagonal() * V.transpose();
}

std::array<Rigid3d, 4> PosesFromEssential(const Eigen::Matrix3d& E) {
  // With E = [b]x R: b b^T = tr(E E^T) / 2 - E E^T, cof(E) = b b^T R, [b]x E = b b^T R - |b|^2 R.
  const Eigen::Matrix3d EEt = E * E.transpose();
  const double squared_norm = 0.5 * EEt.trace();
  Eigen::Matrix3d bbt = -EEt;
  bbt.diagonal().array() += squared_norm;
  int largest;
  bbt.diagonal().maxCoeff(&largest);
  const Eigen::Vector3d b = bbt.col(largest) / std::sqrt(bbt(largest, largest));
  Eigen::Matrix3d cofactors;
  cofactors.row(0) = E.row(1).cross(E.row(2));
  cofactors.row(1) = E.row(2).cross(E.row(0));
  cofactors.row(2) = E.row(0).cross(E.row(1));
  const Eigen::Matrix3d bE = CrossMatrix(b) * E;
  const double scale = 1.0 / b.squaredNorm();
  const Eigen::Matrix3d R1 = (cofactors - bE) * scale, R2 = (cofactors + bE) * scale;
  const Eigen::Vector3d t = b.normalized();
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

bool CheiralityTest::IsInFront(const Eigen::Vector3d& ray1, const Eigen::Vector3d& ray2) const {
  // The depths that bring d1 a + t = d2 b nearest to each other, times det.
  const Eigen::Vector3d a = R_ * ray1;
  const Eigen::Vector3d& b = ray2;
  const double aa = a.squaredNorm(), bb = b.squaredNorm(), ab = a.dot(b);
  const double det = aa * bb - ab * ab;  // aa bb sin^2 of the angle between the rays
  if (ab > 0.0 && det < squared_far_angle_ * aa * bb) return true;
  const double at = a.dot(t_), bt = b.dot(t_);
  return ab * bt - bb * at > 0.0 && aa * bt - ab * at > 0.0;
}

CheiralityResult SelectPoseByCheirality(const Eigen::Matrix3d& E,
                                        const std::vector<Eigen::Vector3d>& rays1,
                                        const std::vector<Eigen::Vector3d>& rays2,
                                        double far_angle) {
  CAIRN_CHECK_EQ(rays1.size(), rays2.size());
  CheiralityResult best;
  best.num_in_front = -1;
  for (const Rigid3d& pose : PosesFromEssential(E)) {
    const CheiralityTest test(pose, far_angle);
    int num_in_front = 0;
    for (size_t i = 0; i < rays1.size(); ++i) num_in_front += test.IsInFront(rays1[i], rays2[i]);
    if (num_in_front > best.num_in_front) best = {pose, num_in_front};
  }
  return best;
}

}  // namespace cairn
