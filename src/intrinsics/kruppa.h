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
struct KruppaResidual {
  Eigen::Vector2d value;
  Eigen::Matrix<double, 2, 4> by_principal_points;  // d value / d (x1, y1, x2, y2)
};
KruppaResidual EvaluateKruppa(const FundamentalFit& fit, const Eigen::Vector2d& log_focals,
                              const Eigen::Vector4d& principal_points = Eigen::Vector4d::Zero());

// Covariance of the value for that of F.
Eigen::Matrix2d KruppaCovariance(const FundamentalFit& fit, const Eigen::Vector2d& log_focals,
                                 const Eigen::Vector4d& principal_points = Eigen::Vector4d::Zero());

}  // namespace cairn::internal
