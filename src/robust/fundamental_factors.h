#pragma once

#include <Eigen/Core>
#include <optional>

namespace cairn {

// A fundamental matrix F = U2 B V2^T with orthonormal 3x2 bases U2 and V2 (the first two columns of
// rotations U and V) and a 2x2 matrix of unit norm. Unlike the singular value decomposition
// (Bartoli and Sturm, "Nonlinear estimation of the fundamental matrix with minimal parameters",
// PAMI 2004), it is smooth where the singular values are equal, and that is where focal lengths are
// right.
struct FundamentalFactors {
  // Directions in which F can move: U Exp(a1, a2, 0), V Exp(b1, b2, 0), B + c1 N1 + c2 N2 + c3 N3.
  static constexpr int kDof = 7;
  using Step = Eigen::Matrix<double, kDof, 1>;
  using Tangents = Eigen::Matrix<double, 9, kDof>;

  Eigen::Matrix3d U, V;
  Eigen::Matrix2d B;

  // Of the nearest matrix of rank 2, with det B >= 0. Absent for zero and what is not finite.
  static std::optional<FundamentalFactors> Of(const Eigen::Matrix3d& F);

  Eigen::Matrix3d F() const { return U.leftCols<2>() * B * V.leftCols<2>().transpose(); }
  // Orthonormal directions N1, N2, N3 of unit norm, orthogonal to B.
  Eigen::Matrix2d Direction(int k) const;
  // d vec(F) (columns one after the other) by the seven steps.
  Tangents ByStep() const;
  FundamentalFactors Moved(const Step& step) const;
};

}  // namespace cairn
