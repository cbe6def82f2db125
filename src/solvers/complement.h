#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace cairn::internal {

// Four orthonormal vectors orthogonal to the five most important directions of N columns (all of
// them when N = 5): Householder reflections with column pivoting (Golub and Van Loan, 5.4). Columns
// of lower rank leave more than one such space; any is returned. Sums run over all columns at once,
// which hides their latency.
template <int N>
Eigen::Matrix<double, 9, 4> ComplementOfFive(const Eigen::Matrix<double, 9, N>& columns) {
  static_assert(N >= 5);
  constexpr int kRows = 9, kSteps = 5;
  double A[kRows][N];
  double squared_norms[N] = {};
  for (int i = 0; i < kRows; ++i) {
    for (int j = 0; j < N; ++j) {
      A[i][j] = columns(i, j);
      squared_norms[j] += A[i][j] * A[i][j];
    }
  }
  double reflectors[kSteps][kRows] = {};  // v, with H = I - v v^T
  for (int k = 0; k < kSteps; ++k) {
    const auto pivot = std::max_element(squared_norms + k, squared_norms + N) - squared_norms;
    std::swap(squared_norms[k], squared_norms[pivot]);
    for (int i = 0; i < kRows; ++i) std::swap(A[i][k], A[i][pivot]);
    double* v = reflectors[k];
    double squared_norm = 0.0;
    for (int i = k; i < kRows; ++i) {
      v[i] = A[i][k];
      squared_norm += v[i] * v[i];
    }
    const double norm = std::sqrt(squared_norm);
    v[k] += std::copysign(norm, v[k]);
    // |v|^2 = 2 norm |v_k|.
    const double scale = norm > 0.0 ? 1.0 / std::sqrt(norm * std::abs(v[k])) : 0.0;
    for (int i = k; i < kRows; ++i) v[i] *= scale;
    double dots[N] = {};
    for (int i = k; i < kRows; ++i) {
      for (int j = 0; j < N; ++j) dots[j] += v[i] * A[i][j];
    }
    for (int i = k; i < kRows; ++i) {
      for (int j = 0; j < N; ++j) A[i][j] -= dots[j] * v[i];
    }
    for (int j = k + 1; j < N; ++j) squared_norms[j] -= A[k][j] * A[k][j];
  }
  double basis[kRows][4] = {};
  for (int j = 0; j < 4; ++j) basis[kSteps + j][j] = 1.0;
  for (int k = kSteps - 1; k >= 0; --k) {
    const double* v = reflectors[k];
    double dots[4] = {};
    for (int i = k; i < kRows; ++i) {
      for (int j = 0; j < 4; ++j) dots[j] += v[i] * basis[i][j];
    }
    for (int i = k; i < kRows; ++i) {
      for (int j = 0; j < 4; ++j) basis[i][j] -= dots[j] * v[i];
    }
  }
  return Eigen::Map<const Eigen::Matrix<double, kRows, 4, Eigen::RowMajor>>(&basis[0][0]);
}

}  // namespace cairn::internal
