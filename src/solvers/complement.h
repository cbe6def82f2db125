#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace cairn::internal {

// Four orthonormal vectors orthogonal to the five most important directions of the given columns
// (all of them when N = 5): Householder reflections with column pivoting (Golub and Van Loan, 5.4).
// Rank-deficient columns give a space that has more than the wanted vectors to choose from; any is
// returned.
template <int N>
Eigen::Matrix<double, 9, 4> ComplementOfFive(Eigen::Matrix<double, 9, N> A) {
  static_assert(N >= 5);
  constexpr int kRows = 9, kSteps = 5;
  double reflectors[kSteps][kRows];  // v, with H = I - v v^T
  for (int k = 0; k < kSteps; ++k) {
    int pivot = k;
    double largest = -1.0;
    for (int j = k; j < N; ++j) {
      double squared_norm = 0.0;
      for (int i = k; i < kRows; ++i) squared_norm += A(i, j) * A(i, j);
      if (squared_norm > largest) {
        largest = squared_norm;
        pivot = j;
      }
    }
    double* x = A.data() + kRows * k;
    double* p = A.data() + kRows * pivot;
    double* v = reflectors[k];
    for (int i = k; i < kRows; ++i) {
      v[i] = p[i];
      p[i] = x[i];
    }
    const double norm = std::sqrt(largest);
    v[k] += std::copysign(norm, v[k]);
    // |v|^2 = 2 norm |v_k|: scaled so that H = I - v v^T.
    const double scale = norm > 0.0 ? 1.0 / std::sqrt(norm * std::abs(v[k])) : 0.0;
    for (int i = k; i < kRows; ++i) v[i] *= scale;
    for (int j = k + 1; j < N; ++j) {
      double* a = A.data() + kRows * j;
      double dot = 0.0;
      for (int i = k; i < kRows; ++i) dot += v[i] * a[i];
      for (int i = k; i < kRows; ++i) a[i] -= dot * v[i];
    }
  }
  Eigen::Matrix<double, 9, 4> basis = Eigen::Matrix<double, 9, 4>::Zero();
  for (int column = 0; column < 4; ++column) {
    double* b = basis.data() + kRows * column;
    b[kSteps + column] = 1.0;
    for (int k = kSteps - 1; k >= 0; --k) {
      const double* v = reflectors[k];
      double dot = 0.0;
      for (int i = k; i < kRows; ++i) dot += v[i] * b[i];
      for (int i = k; i < kRows; ++i) b[i] -= dot * v[i];
    }
  }
  return basis;
}

}  // namespace cairn::internal
