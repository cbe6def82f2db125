#include "resection/p3p.h"

#include <Eigen/LU>
#include <cmath>

#include "cairn/math/decompositions.h"
#include "cairn/solvers/polynomial.h"

namespace cairn {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// The symmetric matrix M with d^T M d = |d_i y_i - d_j y_j|^2 for distances d along unit rays y.
Matrix3d DistanceForm(int i, int j, double cosine) {
  Matrix3d M = Matrix3d::Zero();
  M(i, i) = M(j, j) = 1.0;
  M(i, j) = M(j, i) = -cosine;
  return M;
}

Matrix3d Adjugate(const Matrix3d& M) {
  Matrix3d cofactors;
  for (int i = 0; i < 3; ++i) {
    const Vector3d a = M.row((i + 1) % 3);
    cofactors.row(i) = a.cross(Vector3d(M.row((i + 2) % 3)));
  }
  return cofactors.transpose();
}

// Splits the most clearly degenerate conic A + g B of the pencil into its two lines. False if no
// member is a pair of real lines. use_first: whether A, rather than B, should be met with the
// lines.
bool SplitPencil(const Matrix3d& A, const Matrix3d& B, Vector3d lines[2], bool* use_first) {
  const double cubic[4] = {A.determinant(), (Adjugate(A) * B).trace(), (Adjugate(B) * A).trace(),
                           B.determinant()};
  double roots[3];
  const int num_roots = RealRoots(cubic, 3, roots);
  double best = 0;
  for (int i = 0; i < num_roots; ++i) {
    const double g = roots[i];
    const Matrix3d D = (A + g * B) / (1.0 + std::abs(g));
    const auto [values, vectors] = SymmetricEigen(D);
    // Ascending; the middle one vanishes. Lines are real if the outer ones differ in sign.
    const double product = -values[0] * values[2];
    if (!(product > best)) continue;
    best = product;
    const Vector3d positive = std::sqrt(values[2]) * vectors.col(2);
    const Vector3d negative = std::sqrt(-values[0]) * vectors.col(0);
    lines[0] = positive + negative;
    lines[1] = positive - negative;
    *use_first = std::abs(g) > 1.0;
  }
  return best > 0;
}

// Points d (up to scale) of the line with d^T C d = 0; returns how many.
int MeetLine(const Vector3d& line, const Matrix3d& C, Vector3d points[2]) {
  int axis = 0;
  line.cwiseAbs().minCoeff(&axis);
  const Vector3d u = line.cross(Vector3d::Unit(axis)).normalized();
  const Vector3d v = line.cross(u).normalized();
  // d = p u + q v
  const double a = u.dot(C * u);
  const double b = u.dot(C * v);
  const double c = v.dot(C * v);
  const double discriminant = b * b - a * c;
  if (discriminant < 0) return 0;
  // Each root in the form that does not cancel.
  const double s = b + std::copysign(std::sqrt(discriminant), b);
  points[0] = -s * u + a * v;
  points[1] = c * u - s * v;
  return 2;
}

}  // namespace

int P3pSolver::Solve(const Sample* samples, Model* models) {
  const Vector3d* const x[3] = {&samples[0].xyz, &samples[1].xyz, &samples[2].xyz};
  const Vector3d* const y[3] = {&samples[0].ray, &samples[1].ray, &samples[2].ray};
  // Pair k joins points k and (k + 1) % 3.
  Matrix3d M[3];
  Vector3d squared;  // distances between the points
  for (int k = 0; k < 3; ++k) {
    const int j = (k + 1) % 3;
    M[k] = DistanceForm(k, j, y[k]->dot(*y[j]));
    squared[k] = (*x[k] - *x[j]).squaredNorm();
  }
  const double size = squared.maxCoeff();
  const Vector3d edge1 = *x[1] - *x[0];
  const Vector3d edge2 = *x[2] - *x[0];
  if (!(edge1.cross(edge2).norm() > 1e-9 * size)) return 0;

  // d^T M[k] d = squared[k]; two differences are homogeneous.
  const Vector3d ratio = squared / size;
  const Matrix3d A = M[0] * ratio[1] - M[1] * ratio[0];
  const Matrix3d B = M[2] * ratio[1] - M[1] * ratio[2];
  Vector3d lines[2];
  bool use_first = false;
  if (!SplitPencil(A, B, lines, &use_first)) return 0;

  int num_models = 0;
  for (const Vector3d& line : lines) {
    Vector3d points[2];
    const int num_points = MeetLine(line, use_first ? A : B, points);
    for (int p = 0; p < num_points && num_models < kMaxSolutions; ++p) {
      Vector3d d = points[p];
      if (d.sum() < 0) d = -d;
      if (!(d.minCoeff() > 0)) continue;
      int k = 0;
      squared.maxCoeff(&k);
      const double form = d.dot(M[k] * d);
      if (!(form > 0)) continue;
      d *= std::sqrt(squared[k] / form);
      for (int step = 0; step < 3; ++step) {
        Matrix3d J;
        Vector3d residual;
        for (int i = 0; i < 3; ++i) {
          const Vector3d Md = M[i] * d;
          J.row(i) = 2.0 * Md;
          residual[i] = d.dot(Md) - squared[i];
        }
        const double determinant = J.determinant();
        if (!(std::abs(determinant) > 1e-14 * J.norm() * J.norm() * J.norm())) break;
        d -= J.inverse() * residual;
      }
      if (!(d.minCoeff() > 0) || !d.allFinite()) continue;
      const Vector3d c[3] = {d[0] * *y[0], d[1] * *y[1], d[2] * *y[2]};
      Matrix3d camera;
      Matrix3d world;
      world << edge1, edge2, edge1.cross(edge2);
      const Vector3d camera1 = c[1] - c[0];
      const Vector3d camera2 = c[2] - c[0];
      camera << camera1, camera2, camera1.cross(camera2);
      const Matrix3d R = camera * world.inverse();
      const Eigen::Quaterniond rotation = Eigen::Quaterniond(R).normalized();
      if (!rotation.coeffs().allFinite()) continue;
      models[num_models++] = Rigid3d(rotation, Vector3d(c[0] - rotation * *x[0]));
    }
  }
  return num_models;
}

}  // namespace cairn
