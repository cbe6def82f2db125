#pragma once

#include <Eigen/Core>

namespace cairn::internal {

// The five-point solver's linear algebra over plain arrays (row-major), with the instruction set
// chosen at run time and the same bits with all.

// Four orthonormal vectors orthogonal to the five most important directions of the first n of eight
// columns, n >= 5 (all directions when n = 5), the others being zero: Householder reflections with
// column pivoting (Golub and Van Loan, 5.4). Columns of lower rank leave more than one such space;
// any is returned. columns: 9 x 8, lost. basis: 9 x 4.
void ComplementOfFive(int n, double* columns, double* basis);
template <int N>
Eigen::Matrix<double, 9, 4> ComplementOfFive(const Eigen::Matrix<double, 9, N>& columns) {
  static_assert(N >= 5 && N <= 8);
  Eigen::Matrix<double, 9, 8, Eigen::RowMajor> padded;
  padded.setZero();
  padded.template leftCols<N>() = columns;
  Eigen::Matrix<double, 9, 4, Eigen::RowMajor> basis;
  ComplementOfFive(N, padded.data(), basis.data());
  return basis;
}

// The ten cubic constraints on E = x X + y Y + z Z + W (its determinant, and
// E E^T E - tr(E E^T) E / 2 = 0) as coefficients of 20 monomials, in Nister's order:
//   x3 y3 x2y xy2 x2z x2 y2z y2 xyz xy | xz2 xz x yz2 yz y z3 z2 z 1.
// basis: 9 x 4, columns X, Y, Z, W, each a 3x3 matrix in row-major order; constraints: 10 x 20.
void EssentialConstraints(const double* basis, double* constraints);
using ConstraintMatrix = Eigen::Matrix<double, 10, 20, Eigen::RowMajor>;
inline void EssentialConstraints(const Eigen::Matrix<double, 9, 4>& basis,
                                 ConstraintMatrix* constraints) {
  const Eigen::Matrix<double, 9, 4, Eigen::RowMajor> rows = basis;
  EssentialConstraints(rows.data(), constraints->data());
}

// Gaussian elimination with partial pivoting of 10 x 20 constraints, of which only the last six
// rows (those of the monomials x2z x2 y2z y2 xyz xy) are reduced fully, in the last ten columns.
// False if singular.
bool EliminateConstraints(double* constraints);

}  // namespace cairn::internal
