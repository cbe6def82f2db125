#pragma once

#include <Eigen/Core>

#include "solvers/essential_kernels.h"

namespace cairn::internal {

// See ComplementOfFive in essential_kernels.h.
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

}  // namespace cairn::internal
