#include "intrinsics/kruppa.h"

#include <Eigen/LU>
#include <cmath>

#include "cairn/math/so3.h"

namespace cairn::internal {
namespace {

using Basis = Eigen::Matrix<double, 3, 2>;

// One camera's side: C = basis^T K K^T basis and its Cholesky factor. K K^T = diag(a^2, a^2, 0) +
// center center^T.
struct Side {
  Side(const Eigen::Matrix3d& rotation, double log_focal, const Eigen::Vector2d& principal_point)
      : basis(rotation.leftCols<2>()), center(principal_point.homogeneous()) {
    omega = center * center.transpose();
    omega.diagonal().head<2>().array() += std::exp(2 * log_focal);
    const Eigen::Matrix2d C = basis.transpose() * omega * basis;
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
  Eigen::Matrix2d ByRotation(const Eigen::Matrix3d& rotation, int axis) const {
    const Basis moved = (rotation * CrossMatrix(Eigen::Vector3d::Unit(axis))).leftCols<2>();
    const Eigen::Matrix2d half = moved.transpose() * omega * basis;
    return FactorChange(half + half.transpose());
  }
  Eigen::Matrix2d ByPrincipalPoint(int axis) const {
    const Eigen::Matrix2d half = basis.row(axis).transpose() * (center.transpose() * basis);
    return FactorChange(half + half.transpose());
  }

  Basis basis;
  Eigen::Vector3d center;
  Eigen::Matrix3d omega;  // K K^T
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

KruppaResidual EvaluateKruppa(const FundamentalFit& fit, const Eigen::Vector2d& log_focals,
                              const Eigen::Vector4d& principal_points) {
  const Side side1(fit.V, log_focals[0], principal_points.head<2>());
  const Side side2(fit.U, log_focals[1], principal_points.tail<2>());
  const Split split(side2.L.transpose() * fit.B * side1.L);
  const auto by_side1 = [&](const Eigen::Matrix2d& dL) {
    return split.Change(side2.L.transpose() * fit.B * dL);
  };
  const auto by_side2 = [&](const Eigen::Matrix2d& dL) {
    return split.Change(dL.transpose() * fit.B * side1.L);
  };
  KruppaResidual residual;
  residual.value = split.Value();
  for (int k = 0; k < 2; ++k) {
    residual.by_principal_points.col(k) = by_side1(side1.ByPrincipalPoint(k));
    residual.by_principal_points.col(2 + k) = by_side2(side2.ByPrincipalPoint(k));
  }
  return residual;
}

Eigen::Matrix2d KruppaCovariance(const FundamentalFit& fit, const Eigen::Vector2d& log_focals,
                                 const Eigen::Vector4d& principal_points) {
  const Side side1(fit.V, log_focals[0], principal_points.head<2>());
  const Side side2(fit.U, log_focals[1], principal_points.tail<2>());
  const Split split(side2.L.transpose() * fit.B * side1.L);
  Eigen::Matrix<double, 2, FundamentalFit::kDof> by_fit;
  for (int k = 0; k < 2; ++k) {
    by_fit.col(k) = split.Change(side2.ByRotation(fit.U, k).transpose() * fit.B * side1.L);
    by_fit.col(2 + k) = split.Change(side2.L.transpose() * fit.B * side1.ByRotation(fit.V, k));
  }
  for (int k = 0; k < 3; ++k) {
    by_fit.col(4 + k) = split.Change(side2.L.transpose() * fit.Direction(k) * side1.L);
  }
  return by_fit * fit.covariance * by_fit.transpose();
}

}  // namespace cairn::internal
