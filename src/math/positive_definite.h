#pragma once

#include <Eigen/Core>
#include <cmath>

namespace cairn {

// Solves A x = b by Cholesky's decomposition of A's lower triangle. False, with x as it was, if A
// is not positive definite (or not a number), or if a pivot is less than this share of A's largest
// diagonal element. Plain loops over a few rows: Eigen's LDLT takes seconds to compile, and longer
// to run.
template <int N>
bool SolvePositive(Eigen::Matrix<double, N, N> A, Eigen::Matrix<double, N, 1> b,
                   Eigen::Matrix<double, N, 1>* x, double min_pivot = 0.0) {
  double min_squared = 0.0;
  if (min_pivot > 0.0) {
    for (int j = 0; j < N; ++j) min_squared = std::max(min_squared, min_pivot * A(j, j));
  }
  for (int j = 0; j < N; ++j) {
    double d = A(j, j);
    for (int k = 0; k < j; ++k) d -= A(j, k) * A(j, k);
    if (!(d > min_squared)) return false;
    const double inverse = 1.0 / std::sqrt(d);
    A(j, j) = inverse;
    for (int i = j + 1; i < N; ++i) {
      double sum = A(i, j);
      for (int k = 0; k < j; ++k) sum -= A(i, k) * A(j, k);
      A(i, j) = sum * inverse;
    }
  }
  for (int i = 0; i < N; ++i) {
    for (int k = 0; k < i; ++k) b[i] -= A(i, k) * b[k];
    b[i] *= A(i, i);
  }
  for (int i = N - 1; i >= 0; --i) {
    for (int k = i + 1; k < N; ++k) b[i] -= A(k, i) * b[k];
    b[i] *= A(i, i);
  }
  *x = b;
  return true;
}

}  // namespace cairn
