#pragma once

#include <Eigen/Core>

#include "solvers/essential_kernels.h"

namespace cairn::internal {

// The ten cubic constraints on E = x X + y Y + z Z + W (its determinant, and
// E E^T E - tr(E E^T) E / 2 = 0) as coefficients of 20 monomials, in Nister's order:
//   x3 y3 x2y xy2 x2z x2 y2z y2 xyz xy | xz2 xz x yz2 yz y z3 z2 z 1.
// `basis`: columns X, Y, Z, W, each a 3x3 matrix in row-major order.
using ConstraintMatrix = Eigen::Matrix<double, 10, 20, Eigen::RowMajor>;
inline void EssentialConstraints(const Eigen::Matrix<double, 9, 4>& basis,
                                 ConstraintMatrix* constraints) {
  const Eigen::Matrix<double, 9, 4, Eigen::RowMajor> rows = basis;
  EssentialConstraints(rows.data(), constraints->data());
}

}  // namespace cairn::internal
