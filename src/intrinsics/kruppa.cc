#include "intrinsics/kruppa.h"

#include <Eigen/LU>
#include <cmath>

#include "cairn/math/so3.h"

namespace cairn::internal {

KruppaEquations::KruppaEquations(const FundamentalFit& fit, const Eigen::Vector2d& log_focals,
                                 const Eigen::Vector4d& principal_points)
    : fit_(fit),
      side1_(fit.V, log_focals[0], principal_points.head<2>()),
      side2_(fit.U, log_focals[1], principal_points.tail<2>()),
      split_(side2_.L.transpose() * fit.B * side1_.L) {}

Eigen::Matrix<double, 2, 4> KruppaEquations::ByPrincipalPoints() const {
  Eigen::Matrix<double, 2, 4> by;
  for (int k = 0; k < 2; ++k) {
    by.col(k) = By1(side1_.ByPrincipalPoint(k));
    by.col(2 + k) = By2(side2_.ByPrincipalPoint(k));
  }
  return by;
}

Eigen::Matrix<double, 2, FundamentalFit::kDof> KruppaEquations::ByFit() const {
  Eigen::Matrix<double, 2, FundamentalFit::kDof> by_fit;
  for (int k = 0; k < 2; ++k) {
    by_fit.col(k) = By2(side2_.ByRotation(fit_.U, k));
    by_fit.col(2 + k) = By1(side1_.ByRotation(fit_.V, k));
  }
  for (int k = 0; k < 3; ++k) {
    by_fit.col(4 + k) = split_.Change(side2_.L.transpose() * fit_.Direction(k) * side1_.L);
  }
  return by_fit;
}

Eigen::Matrix2d KruppaEquations::Covariance() const {
  const auto by_fit = ByFit();
  return by_fit * fit_.covariance * by_fit.transpose();
}

Eigen::Matrix2d KruppaEquations::CovarianceOfNoise() const {
  const auto by_fit = ByFit();
  return by_fit * fit_.covariance_of_noise * by_fit.transpose();
}

// K K^T = diag(a^2, a^2, 0) + center center^T.
KruppaEquations::Side::Side(const Eigen::Matrix3d& rotation, double log_focal,
                            const Eigen::Vector2d& principal_point)
    : basis(rotation.leftCols<2>()), center(principal_point.homogeneous()) {
  omega = center * center.transpose();
  omega.diagonal().head<2>().array() += std::exp(2 * log_focal);
  const Eigen::Matrix2d C = basis.transpose() * omega * basis;
  L(0, 0) = std::sqrt(C(0, 0));
  L(1, 0) = C(1, 0) / L(0, 0);
  L(1, 1) = std::sqrt(std::max(C(1, 1) - L(1, 0) * L(1, 0), 1e-300));
  L(0, 1) = 0;
}

// L times the lower triangle, with half of the diagonal, of L^-1 dC L^-T.
Eigen::Matrix2d KruppaEquations::Side::FactorChange(const Eigen::Matrix2d& dC) const {
  const Eigen::Matrix2d inverse = L.inverse();
  Eigen::Matrix2d change = inverse * dC * inverse.transpose();
  change.diagonal() *= 0.5;
  change(0, 1) = 0;
  return L * change;
}

Eigen::Matrix2d KruppaEquations::Side::ByRotation(const Eigen::Matrix3d& rotation, int axis) const {
  const Eigen::Matrix<double, 3, 2> moved =
      (rotation * CrossMatrix(Eigen::Vector3d::Unit(axis))).leftCols<2>();
  const Eigen::Matrix2d half = moved.transpose() * omega * basis;
  return FactorChange(half + half.transpose());
}

Eigen::Matrix2d KruppaEquations::Side::ByPrincipalPoint(int axis) const {
  const Eigen::Matrix2d half = basis.row(axis).transpose() * (center.transpose() * basis);
  return FactorChange(half + half.transpose());
}

Eigen::Vector2d KruppaEquations::Split::Change(const Eigen::Matrix2d& dM) const {
  const Split d(dM);
  return (d.q - q * (p.dot(d.p) / p.squaredNorm())) / p.norm();
}

}  // namespace cairn::internal
