#pragma once

#include <Eigen/Core>

namespace cairn {

// Gauss-Newton's model of a cost that is a sum of squares or of robust losses rho(e^2), as a state
// moves along N directions: cost(step) = cost + 2 gradient^T step + step^T hessian step.
template <int N>
struct NormalEquations {
  using Vector = Eigen::Matrix<double, N, 1>;
  using Matrix = Eigen::Matrix<double, N, N>;
  Matrix hessian = Matrix::Zero();   // sum of rho' J^T J; its lower triangle counts
  Vector gradient = Vector::Zero();  // sum of rho' J^T e
  double cost = 0.0;                 // sum of rho(e^2)

  // One more residual: its error, its derivative, and rho'.
  void Add(double error, const Vector& J, double weight) {
    for (int j = 0; j < N; ++j) {
      const double scaled = weight * J[j];
      gradient[j] += scaled * error;
      for (int i = j; i < N; ++i) hessian(i, j) += scaled * J[i];
    }
  }

  // Of moves in K directions, the columns, alone.
  template <int K>
  NormalEquations<K> Along(const Eigen::Matrix<double, N, K>& directions) const {
    NormalEquations<K> along;
    along.cost = cost;
    for (int k = 0; k < K; ++k) {
      Vector product = Vector::Zero();  // hessian times the direction
      for (int j = 0; j < N; ++j) {
        along.gradient[k] += directions(j, k) * gradient[j];
        product[j] += hessian(j, j) * directions(j, k);
        for (int i = j + 1; i < N; ++i) {
          product[i] += hessian(i, j) * directions(j, k);
          product[j] += hessian(i, j) * directions(i, k);
        }
      }
      for (int l = k; l < K; ++l) {
        for (int j = 0; j < N; ++j) along.hessian(l, k) += directions(j, l) * product[j];
      }
    }
    return along;
  }
};

}  // namespace cairn
