#include "cairn/solvers/essential.h"

#include <Eigen/Geometry>
#include <cmath>

#include "cairn/math/decompositions.h"
#include "cairn/math/so3.h"

namespace cairn {

EssentialDecomposition DecomposeEssential(const Eigen::Matrix3d& E) {
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
  return {(cofactors - bE) * scale, (cofactors + bE) * scale, b.normalized()};
}

Eigen::Matrix3d NearestEssential(const Eigen::Matrix3d& matrix) {
  const auto [U, V, s] = SingularValues(matrix);
  return U * Eigen::Vector3d(1.0, 1.0, 0.0).asDiagonal() * V.transpose();
}

}  // namespace cairn
