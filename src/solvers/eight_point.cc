#include "cairn/solvers/eight_point.h"

#include <Eigen/Geometry>

#include "cairn/math/decompositions.h"
#include "solvers/point_normalization.h"

namespace cairn {

bool FundamentalFromEightPoints(std::span<const PointCorrespondence> samples, Eigen::Matrix3d* F) {
  if (samples.size() < 8) return false;
  internal::PointNormalization T1, T2;
  if (!internal::NormalizePoints(samples, &PointCorrespondence::x1, &T1) ||
      !internal::NormalizePoints(samples, &PointCorrespondence::x2, &T2)) {
    return false;
  }
  Eigen::Matrix<double, 9, 9> AtA = Eigen::Matrix<double, 9, 9>::Zero();
  for (const PointCorrespondence& sample : samples) {
    const Eigen::Vector3d p1 = T1.Apply(sample.x1).homogeneous();
    const Eigen::Vector3d p2 = T2.Apply(sample.x2).homogeneous();
    Eigen::Matrix<double, 9, 1> row;
    row << p2.x() * p1, p2.y() * p1, p1;
    AtA += row.lazyProduct(row.transpose());
  }
  Eigen::Matrix<double, 9, 1> f;
  if (!LeastEigenvector(AtA, &f)) return false;
  // The nearest matrix of rank 2, in the normalized coordinates.
  const auto [U, V, s] =
      SingularValues(Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(f.data()));
  const Eigen::Matrix3d normalized =
      U * Eigen::Vector3d(s.x(), s.y(), 0.0).asDiagonal() * V.transpose();
  *F = (T2.Matrix().transpose() * normalized * T1.Matrix()).normalized();
  return true;
}

}  // namespace cairn
