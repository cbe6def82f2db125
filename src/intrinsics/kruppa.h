#pragma once

#include <Eigen/Core>

#include "intrinsics/fundamental_fit.h"

namespace cairn::internal {

// How far K2^T F K1 is from an essential matrix for K = (a, 0, x; 0, a, y; 0, 0, 1), a the true
// focal length over the nominal one and (x, y) the true principal point minus the nominal one, over
// the nominal focal length: its singular values must be equal. With C = U2^T K2 K2^T U2 = L L^T
// (2x2; of V2 and K1 likewise) they are those of M = L2^T B L1, and M has equal ones if its part
// that is no rotation, q = (M11 - M22, M12 + M21), vanishes beside the part that is, p = (M11 +
// M22, M21 - M12). The residual q / |p| has the length (s1 - s2) / (s1 + s2): two equations,
// Kruppa's.
class KruppaEquations {
 public:
  // The fit outlives this. Principal points: (x1, y1, x2, y2).
  KruppaEquations(const FundamentalFit& fit, const Eigen::Vector2d& log_focals,
                  const Eigen::Vector4d& principal_points = Eigen::Vector4d::Zero());

  Eigen::Vector2d Residual() const { return split_.Value(); }
  Eigen::Matrix<double, 2, 4> ByPrincipalPoints() const;
  // Of the residual, for that of F; and its part that is the noise's.
  Eigen::Matrix2d Covariance() const;
  Eigen::Matrix2d CovarianceOfNoise() const;

 private:
  // One camera's side: C = basis^T K K^T basis and its Cholesky factor.
  struct Side {
    Side(const Eigen::Matrix3d& rotation, double log_focal, const Eigen::Vector2d& principal_point);
    // dL for dC.
    Eigen::Matrix2d FactorChange(const Eigen::Matrix2d& dC) const;
    Eigen::Matrix2d ByRotation(const Eigen::Matrix3d& rotation, int axis) const;
    Eigen::Matrix2d ByPrincipalPoint(int axis) const;

    Eigen::Matrix<double, 3, 2> basis;
    Eigen::Vector3d center;
    Eigen::Matrix3d omega;  // K K^T
    Eigen::Matrix2d L;
  };
  // M's p and q.
  struct Split {
    explicit Split(const Eigen::Matrix2d& M)
        : p(M(0, 0) + M(1, 1), M(1, 0) - M(0, 1)), q(M(0, 0) - M(1, 1), M(0, 1) + M(1, 0)) {}
    Eigen::Vector2d Value() const { return q / p.norm(); }
    // Of the value, with M.
    Eigen::Vector2d Change(const Eigen::Matrix2d& dM) const;
    Eigen::Vector2d p, q;
  };
  // Changes of the residual with the steps of F.
  Eigen::Matrix<double, 2, FundamentalFit::kDof> ByFit() const;
  // Changes of the residual with a side's L.
  Eigen::Vector2d By1(const Eigen::Matrix2d& dL) const {
    return split_.Change(side2_.L.transpose() * fit_.B * dL);
  }
  Eigen::Vector2d By2(const Eigen::Matrix2d& dL) const {
    return split_.Change(dL.transpose() * fit_.B * side1_.L);
  }

  const FundamentalFit& fit_;
  Side side1_, side2_;
  Split split_;
};

}  // namespace cairn::internal
