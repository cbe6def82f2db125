#include "robust/fundamental_factors.h"

#include "cairn/math/decompositions.h"
#include "cairn/math/so3.h"

namespace cairn {

std::optional<FundamentalFactors> FundamentalFactors::Of(const Eigen::Matrix3d& F) {
  if (!F.allFinite() || F.isZero(0.0)) return std::nullopt;
  const auto [U, V, s] = SingularValuesWithRotations(F);
  return FundamentalFactors{U, V, s.head<2>().normalized().asDiagonal()};
}

Eigen::Matrix2d FundamentalFactors::Direction(int k) const {
  // Products of B, as a quaternion, with the three units are orthogonal to it and to each other.
  const double a = B(0, 0), b = B(1, 0), c = B(0, 1), d = B(1, 1);
  Eigen::Matrix2d N;
  if (k == 0) N << -b, -d, a, c;
  if (k == 1) N << -c, a, d, -b;
  if (k == 2) N << -d, b, -c, a;
  return N;
}

FundamentalFactors::Tangents FundamentalFactors::ByStep() const {
  Tangents tangents;
  const auto set = [&](int k, const Eigen::Matrix3d& by_step) {
    tangents.col(k) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(by_step.data());
  };
  Eigen::Matrix3d middle = Eigen::Matrix3d::Zero();
  middle.topLeftCorner<2, 2>() = B;
  const Eigen::Matrix3d left = U * middle, right = middle * V.transpose();
  for (int k = 0; k < 2; ++k) {
    const Eigen::Matrix3d W = CrossMatrix(Eigen::Vector3d::Unit(k));
    set(k, U * W * right);
    set(2 + k, -left * W * V.transpose());
  }
  for (int k = 0; k < 3; ++k) {
    set(4 + k, U.leftCols<2>() * Direction(k) * V.leftCols<2>().transpose());
  }
  return tangents;
}

FundamentalFactors FundamentalFactors::Moved(const Step& step) const {
  FundamentalFactors moved = *this;
  moved.U = U * ExpSO3({step[0], step[1], 0}).toRotationMatrix();
  moved.V = V * ExpSO3({step[2], step[3], 0}).toRotationMatrix();
  for (int k = 0; k < 3; ++k) moved.B += step[4 + k] * Direction(k);
  moved.B.normalize();
  return moved;
}

}  // namespace cairn
