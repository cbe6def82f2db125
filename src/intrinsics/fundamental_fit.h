#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace cairn::internal {

// A fundamental matrix F = U2 B V2^T with orthonormal 3x2 bases U2 and V2 (the first two columns of
// rotations U and V) and a 2x2 matrix of unit norm and positive determinant. Unlike the singular
// value decomposition, it is smooth where the singular values are equal, and that is where focal
// lengths are right.
struct FundamentalFit {
  // Directions in which F can move: U Exp(a1, a2, 0), V Exp(b1, b2, 0), B + c1 N1 + c2 N2 + c3 N3.
  static constexpr int kDof = 7;

  Eigen::Matrix3d U, V;
  Eigen::Matrix2d B;
  Eigen::Matrix<double, kDof, kDof> covariance;  // of these seven
  double sigma_px = 0;                           // of the matches, by their median error

  Eigen::Matrix3d F() const { return U.leftCols<2>() * B * V.leftCols<2>().transpose(); }
  // Orthonormal directions N1, N2, N3 of unit norm, orthogonal to B.
  Eigen::Matrix2d Direction(int k) const;
};

// Steps in the seven directions, and d vec(F) (columns one after the other) by them.
using FundamentalStep = Eigen::Matrix<double, FundamentalFit::kDof, 1>;
using FundamentalTangents = Eigen::Matrix<double, 9, FundamentalFit::kDof>;
FundamentalTangents Tangents(const FundamentalFit& fit);
FundamentalFit Moved(const FundamentalFit& fit, const FundamentalStep& step);

// U, B and V alone. Absent for matrices that are not finite or of rank 1.
std::optional<FundamentalFit> DecomposeFundamental(const Eigen::Matrix3d& F);

// Minimizes the robust Sampson error (Geman-McClure) of rays x1, x2 (third component 1; divided by
// nominal focal lengths, in pixels, which turn errors into pixels) from `start`. Absent for fewer
// than 15 matches, or where they do not determine F at all.
std::optional<FundamentalFit> FitFundamental(std::span<const Eigen::Vector2d> x1,
                                             std::span<const Eigen::Vector2d> x2, double focal1_px,
                                             double focal2_px, const Eigen::Matrix3d& start);

}  // namespace cairn::internal
