#include "solvers/essential_constraints.h"

namespace cairn::internal {
namespace {

// Polynomials in x, y, z: linear (x y z 1), quadratic (x2 xy xz y2 yz z2 x y z 1), cubic (see the
// header).
using Linear = Eigen::Matrix<double, 4, 1>;
using Quadratic = Eigen::Matrix<double, 10, 1>;

inline void AddProduct(const Linear& a, const Linear& b, double factor, Quadratic* out) {
  Quadratic& p = *out;
  p[0] += factor * (a[0] * b[0]);
  p[1] += factor * (a[0] * b[1] + a[1] * b[0]);
  p[2] += factor * (a[0] * b[2] + a[2] * b[0]);
  p[3] += factor * (a[1] * b[1]);
  p[4] += factor * (a[1] * b[2] + a[2] * b[1]);
  p[5] += factor * (a[2] * b[2]);
  p[6] += factor * (a[0] * b[3] + a[3] * b[0]);
  p[7] += factor * (a[1] * b[3] + a[3] * b[1]);
  p[8] += factor * (a[2] * b[3] + a[3] * b[2]);
  p[9] += factor * (a[3] * b[3]);
}

inline void AddProduct(const Quadratic& p, const Linear& q, double* c) {
  c[0] += p[0] * q[0];
  c[1] += p[3] * q[1];
  c[2] += p[0] * q[1] + p[1] * q[0];
  c[3] += p[1] * q[1] + p[3] * q[0];
  c[4] += p[0] * q[2] + p[2] * q[0];
  c[5] += p[0] * q[3] + p[6] * q[0];
  c[6] += p[3] * q[2] + p[4] * q[1];
  c[7] += p[3] * q[3] + p[7] * q[1];
  c[8] += p[1] * q[2] + p[2] * q[1] + p[4] * q[0];
  c[9] += p[1] * q[3] + p[6] * q[1] + p[7] * q[0];
  c[10] += p[2] * q[2] + p[5] * q[0];
  c[11] += p[2] * q[3] + p[6] * q[2] + p[8] * q[0];
  c[12] += p[6] * q[3] + p[9] * q[0];
  c[13] += p[4] * q[2] + p[5] * q[1];
  c[14] += p[4] * q[3] + p[7] * q[2] + p[8] * q[1];
  c[15] += p[7] * q[3] + p[9] * q[1];
  c[16] += p[5] * q[2];
  c[17] += p[5] * q[3] + p[8] * q[2];
  c[18] += p[8] * q[3] + p[9] * q[2];
  c[19] += p[9] * q[3];
}

}  // namespace

void EssentialConstraints(const Eigen::Matrix<double, 9, 4>& basis, ConstraintMatrix* constraints) {
  Linear E[3][3];
  for (int i = 0; i < 9; ++i) E[i / 3][i % 3] = basis.row(i).transpose();
  constraints->setZero();

  // E E^T, and E E^T - tr(E E^T) / 2.
  Quadratic L[3][3];
  for (int i = 0; i < 3; ++i) {
    for (int j = i; j < 3; ++j) {
      L[i][j].setZero();
      for (int k = 0; k < 3; ++k) AddProduct(E[i][k], E[j][k], 1.0, &L[i][j]);
      if (j > i) L[j][i] = L[i][j];
    }
  }
  const Quadratic half_trace = 0.5 * (L[0][0] + L[1][1] + L[2][2]);
  for (int i = 0; i < 3; ++i) L[i][i] -= half_trace;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      double* row = constraints->data() + 20 * (3 * i + j);
      for (int k = 0; k < 3; ++k) AddProduct(L[i][k], E[k][j], row);
    }
  }
  double* determinant = constraints->data() + 20 * 9;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    Quadratic minor = Quadratic::Zero();
    AddProduct(E[1][j], E[2][k], 1.0, &minor);
    AddProduct(E[1][k], E[2][j], -1.0, &minor);
    AddProduct(minor, E[0][i], determinant);
  }
}

}  // namespace cairn::internal
