#include "cairn/solvers/five_point.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "cairn/solvers/polynomial.h"
#include "math/positive_definite.h"
#include "solvers/essential_kernels.h"

namespace cairn {
namespace {

using internal::ConstraintMatrix;

// Coefficients of a polynomial in z, lowest first.
struct Entry {
  double c[5];
};

// One row of Nister's 3x3 matrix B(z), from the difference row(p) - z row(q), on (x, y, 1).
struct BRow {
  Entry x, y, one;  // degrees 3, 3, 4
};

BRow MakeRow(const double* p, const double* q) {
  // Columns 10..19: xz2 xz x | yz2 yz y | z3 z2 z 1.
  BRow row;
  row.x = {{p[12], p[11] - q[12], p[10] - q[11], -q[10], 0.0}};
  row.y = {{p[15], p[14] - q[15], p[13] - q[14], -q[13], 0.0}};
  row.one = {{p[19], p[18] - q[19], p[17] - q[18], p[16] - q[17], -q[16]}};
  return row;
}

// Of entries of degree 3.
void AddProduct(const Entry& a, const Entry& b, double factor, double* out) {
  for (int i = 0; i <= 3; ++i) {
    for (int j = 0; j <= 3; ++j) out[i + j] += factor * a.c[i] * b.c[j];
  }
}

// det B(z), degree 10.
void Determinant(const BRow rows[3], double det[11]) {
  for (int i = 0; i <= 10; ++i) det[i] = 0.0;
  for (int r = 0; r < 3; ++r) {
    const BRow& a = rows[(r + 1) % 3];
    const BRow& b = rows[(r + 2) % 3];
    double minor[7] = {};  // of the columns x and y
    AddProduct(a.x, b.y, 1.0, minor);
    AddProduct(a.y, b.x, -1.0, minor);
    for (int i = 0; i <= 6; ++i) {
      for (int j = 0; j <= 4; ++j) det[i + j] += minor[i] * rows[r].one.c[j];
    }
  }
}

double Evaluate(const Entry& entry, int degree, double z) {
  double value = entry.c[degree];
  for (int i = degree - 1; i >= 0; --i) value = value * z + entry.c[i];
  return value;
}

// x and y from the null vector of B(z). False if it lies at infinity.
bool BackSubstitute(const BRow rows[3], double z, double* x, double* y) {
  Eigen::Vector3d b[3];
  for (int i = 0; i < 3; ++i) {
    b[i] = {Evaluate(rows[i].x, 3, z), Evaluate(rows[i].y, 3, z), Evaluate(rows[i].one, 4, z)};
  }
  Eigen::Vector3d best = b[0].cross(b[1]);
  for (int i = 1; i < 3; ++i) {
    const Eigen::Vector3d other = b[i].cross(b[(i + 1) % 3]);
    if (std::abs(other.z()) > std::abs(best.z())) best = other;
  }
  if (best.z() == 0.0) return false;
  *x = best.x() / best.z();
  *y = best.y() / best.z();
  return std::isfinite(*x) && std::isfinite(*y);
}

using Vector10d = Eigen::Matrix<double, 10, 1>;

// The ten constraints at E, without the scale of E.
Vector10d Residuals(const Eigen::Matrix3d& E) {
  const Eigen::Matrix3d EEt = E * E.transpose();
  const Eigen::Matrix3d cubic = EEt * E - 0.5 * EEt.trace() * E;
  Vector10d r;
  r << cubic.row(0).transpose(), cubic.row(1).transpose(), cubic.row(2).transpose(),
      E.determinant();
  return r;
}

// Their derivative in the direction D.
Vector10d Derivative(const Eigen::Matrix3d& E, const Eigen::Matrix3d& D) {
  const Eigen::Matrix3d EEt = E * E.transpose();
  const Eigen::Matrix3d DEt = D * E.transpose();
  const Eigen::Matrix3d cubic =
      (DEt + DEt.transpose()) * E + EEt * D - DEt.trace() * E - 0.5 * EEt.trace() * D;
  Vector10d r;
  r << cubic.row(0).transpose(), cubic.row(1).transpose(), cubic.row(2).transpose(),
      D.row(0).dot(E.row(1).cross(E.row(2))) + E.row(0).dot(D.row(1).cross(E.row(2))) +
          E.row(0).dot(E.row(1).cross(D.row(2)));
  return r;
}

Eigen::Matrix3d ToMatrix(const Eigen::Matrix<double, 9, 1>& v) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(v.data());
}

// Gauss-Newton over the unit vectors of the four-dimensional space, until the constraints hold to
// rounding. False if the point is not a root of them.
bool Polish(const Eigen::Matrix<double, 9, 4>& basis, Eigen::Vector4d v, Eigen::Matrix3d* E) {
  constexpr double kExact = 1e-12;
  constexpr double kAcceptable = 1e-7;
  *E = ToMatrix(basis * v);
  Vector10d r = Residuals(*E);
  for (int iteration = 0; iteration < 4 && !(r.cwiseAbs().maxCoeff() < kExact); ++iteration) {
    Eigen::Matrix<double, 10, 4> J;
    for (int k = 0; k < 4; ++k) J.col(k) = Derivative(*E, ToMatrix(basis.col(k)));
    // The fourth direction, along v itself, is fixed by v v^T.
    const Eigen::Matrix4d H = J.transpose() * J + v * v.transpose();
    Eigen::Vector4d step;
    if (!SolvePositive<4>(H, J.transpose() * r, &step)) break;
    const Eigen::Vector4d next = (v - step).normalized();
    const Eigen::Matrix3d next_E = ToMatrix(basis * next);
    const Vector10d next_r = Residuals(next_E);
    if (!(next_r.squaredNorm() < r.squaredNorm())) break;
    v = next;
    *E = next_E;
    r = next_r;
  }
  return r.cwiseAbs().maxCoeff() < kAcceptable;
}

}  // namespace

int SolveEssentialInSpace(const Eigen::Matrix<double, 9, 4>& basis, Eigen::Matrix3d* models) {
  ConstraintMatrix constraints;
  internal::EssentialConstraints(basis, &constraints);
  if (!internal::EliminateConstraints(constraints.data())) return 0;
  BRow rows[3];
  for (int i = 0; i < 3; ++i) {
    rows[i] = MakeRow(constraints.data() + 20 * (4 + 2 * i), constraints.data() + 20 * (5 + 2 * i));
  }
  double determinant[11], z[10];
  Determinant(rows, determinant);
  const int num_roots = RealRoots(determinant, 10, z);
  int count = 0;
  for (int i = 0; i < num_roots; ++i) {
    double x, y;
    if (!BackSubstitute(rows, z[i], &x, &y)) continue;
    const Eigen::Vector4d v = Eigen::Vector4d(x, y, z[i], 1.0).normalized();
    if (!Polish(basis, v, &models[count])) continue;
    models[count] *= std::numbers::sqrt2;
    ++count;
  }
  return count;
}

int FivePoint::Solve(const Sample* samples, Model* models) {
  Eigen::Matrix<double, 9, 5> equations;
  for (int i = 0; i < 5; ++i) {
    const double x1 = samples[i].x1.x(), y1 = samples[i].x1.y();
    const double x2 = samples[i].x2.x(), y2 = samples[i].x2.y();
    equations.col(i) << x2 * x1, x2 * y1, x2, y2 * x1, y2 * y1, y2, x1, y1, 1.0;
  }
  return SolveEssentialInSpace(internal::ComplementOfFive(equations), models);
}

}  // namespace cairn
