#include "intrinsics/kruppa.h"

#include <Eigen/LU>
#include <cmath>

#include "cairn/math/so3.h"

namespace cairn::internal {
namespace {

using Basis = Eigen::Matrix<double, 3, 2>;

// One camera's side: C = basis^T K K^T basis and its Cholesky factor.
struct Side {
  Side(const Eigen::Matrix3d& rotation, double log_focal)
      : basis(rotation.leftCols<2>()), omega(Eigen::Vector3d::Ones()) {
    omega.head<2>() *= std::exp(2 * log_focal);
    const Eigen::Matrix2d C = basis.transpose() * omega.asDiagonal() * basis;
    L(0, 0) = std::sqrt(C(0, 0));
    L(1, 0) = C(1, 0) / L(0, 0);
    L(1, 1) = std::sqrt(std::max(C(1, 1) - L(1, 0) * L(1, 0), 1e-300));
    L(0, 1) = 0;
  }
  // dL for dC: L times the lower triangle, with half of the diagonal, of L^-1 dC L^-T.
  Eigen::Matrix2d FactorChange(const Eigen::Matrix2d& dC) const {
    const Eigen::Matrix2d inverse = L.inverse();
    Eigen::Matrix2d change = inverse * dC * inverse.transpose();
    change.diagonal() *= 0.5;
    change(0, 1) = 0;
    return L * change;
  }
  Eigen::Matrix2d ByLogFocal() const {
    Eigen::Vector3d change = 2 * omega;
    change.z() = 0;
    return FactorChange(basis.transpose() * change.asDiagonal() * basis);
  }
  Eigen::Matrix2d ByRotation(const Eigen::Matrix3d& rotation, int axis) const {
    const Basis moved = (rotation * CrossMatrix(Eigen::Vector3d::Unit(axis))).leftCols<2>();
    const Eigen::Matrix2d half = moved.transpose() * omega.asDiagonal() * basis;
    return FactorChange(half + half.transpose());
  }
  Eigen::Matrix2d ByPrincipalPoint(int axis) const {
    const Eigen::Matrix2d half = basis.row(axis).transpose() * basis.row(2);
    return FactorChange(half + half.transpose());
  }

  Basis basis;
  Eigen::Vector3d omega;  // diagonal of K K^T
  Eigen::Matrix2d L;
};

// q / |p| of M, and its change with M.
struct Split {
  explicit Split(const Eigen::Matrix2d& M)
      : p(M(0, 0) + M(1, 1), M(1, 0) - M(0, 1)), q(M(0, 0) - M(1, 1), M(0, 1) + M(1, 0)) {}
  Eigen::Vector2d Value() const { return q / p.norm(); }
  Eigen::Vector2d Change(const Eigen::Matrix2d& dM) const {
    const Split d(dM);
    return (d.q - q * (p.dot(d.p) / p.squaredNorm())) / p.norm();
  }
  Eigen::Vector2d p, q;
};

}  // namespace

KruppaResidual EvaluateKruppa(const FundamentalFit& fit, const Eigen::Vector2d& log_focals) {
  const Side side1(fit.V, log_focals[0]), side2(fit.U, log_focals[1]);
  const Split split(side2.L.transpose() * fit.B * side1.L);
  KruppaResidual residual;
  residual.value = split.Value();
  residual.by_log_focals.col(0) = split.Change(side2.L.transpose() * fit.B * side1.ByLogFocal());
  residual.by_log_focals.col(1) = split.Change(side2.ByLogFocal().transpose() * fit.B * side1.L);
  return residual;
}

Eigen::Matrix2d KruppaCovariance(const FundamentalFit& fit, const Eigen::Vector2d& log_focals,
                                 const Eigen::Vector2d& principal_point_sigmas) {
  const Side side1(fit.V, log_focals[0]), side2(fit.U, log_focals[1]);
  const Split split(side2.L.transpose() * fit.B * side1.L);
  const auto by_side1 = [&](const Eigen::Matrix2d& dL) {
    return split.Change(side2.L.transpose() * fit.B * dL);
  };
  const auto by_side2 = [&](const Eigen::Matrix2d& dL) {
    return split.Change(dL.transpose() * fit.B * side1.L);
  };
  Eigen::Matrix<double, 2, FundamentalFit::kDof> by_fit;
  Eigen::Matrix<double, 2, 4> by_principal_points;
  for (int k = 0; k < 2; ++k) {
    by_fit.col(k) = by_side2(side2.ByRotation(fit.U, k));
    by_fit.col(2 + k) = by_side1(side1.ByRotation(fit.V, k));
    by_principal_points.col(k) = principal_point_sigmas[0] * by_side1(side1.ByPrincipalPoint(k));
    by_principal_points.col(2 + k) =
        principal_point_sigmas[1] * by_side2(side2.ByPrincipalPoint(k));
  }
  for (int k = 0; k < 3; ++k) {
    by_fit.col(4 + k) = split.Change(side2.L.transpose() * fit.Direction(k) * side1.L);
  }
  return by_fit * fit.covariance * by_fit.transpose() +
         by_principal_points * by_principal_points.transpose();
}

}  // namespace cairn::internal
