#pragma once

#include <Eigen/Core>
#include <cmath>

namespace cairn {

// Householder's QR decomposition of a matrix of R rows and C < R columns (Golub and Van Loan, 5.2),
// without pivoting, in plain loops (Eigen's takes seconds to compile).
template <int R, int C>
class Householder {
  static_assert(C < R);

 public:
  using Vector = Eigen::Matrix<double, R, 1>;

  explicit Householder(const Eigen::Matrix<double, R, C>& A) : A_(A) {
    for (int k = 0; k < C; ++k) {
      double squared_norm = 0.0;
      for (int i = k; i < R; ++i) squared_norm += A_(i, k) * A_(i, k);
      const double norm = std::sqrt(squared_norm);
      for (int i = 0; i < R; ++i) reflectors_(i, k) = i < k ? 0.0 : A_(i, k);
      reflectors_(k, k) += std::copysign(norm, A_(k, k));
      // |v|^2 = 2 norm |v_k|; H = I - v v^T.
      const double scale = norm > 0.0 ? 1.0 / std::sqrt(norm * std::abs(reflectors_(k, k))) : 0.0;
      for (int i = k; i < R; ++i) reflectors_(i, k) *= scale;
      for (int j = k; j < C; ++j) Reflect(k, A_.data() + R * j);
    }
  }

  // Orthonormal vectors, as columns, that are orthogonal to A's columns.
  Eigen::Matrix<double, R, R - C> Complement() const {
    Eigen::Matrix<double, R, R - C> basis;
    basis.setZero();
    for (int j = 0; j < R - C; ++j) {
      basis(C + j, j) = 1.0;
      for (int k = C - 1; k >= 0; --k) Reflect(k, basis.data() + R * j);
    }
    return basis;
  }

  // min |A x - b|. Not finite if A's columns are dependent.
  Eigen::Matrix<double, C, 1> Solve(Vector b) const {
    for (int k = 0; k < C; ++k) Reflect(k, b.data());
    Eigen::Matrix<double, C, 1> x;
    for (int k = C - 1; k >= 0; --k) {
      double sum = b[k];
      for (int j = k + 1; j < C; ++j) sum -= A_(k, j) * x[j];
      x[k] = sum / A_(k, k);
    }
    return x;
  }

 private:
  // The column's elements from k on.
  void Reflect(int k, double* column) const {
    double dot = 0.0;
    for (int i = k; i < R; ++i) dot += reflectors_(i, k) * column[i];
    for (int i = k; i < R; ++i) column[i] -= dot * reflectors_(i, k);
  }

  Eigen::Matrix<double, R, C> A_;  // turns into R
  Eigen::Matrix<double, R, C> reflectors_;
};

}  // namespace cairn
