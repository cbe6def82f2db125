#include "cairn/solvers/two_affine.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "cairn/solvers/five_point.h"
#include "math/householder.h"
#include "solvers/essential_kernels.h"

namespace cairn {
namespace {

using Row9 = Eigen::Matrix<double, 1, 9>;

// Coefficients of p2^T E p1 in the entries of E, row-major.
Row9 Bilinear(const Eigen::Vector3d& p1, const Eigen::Vector3d& p2) {
  Row9 row;
  row << p2.x() * p1.transpose(), p2.y() * p1.transpose(), p2.z() * p1.transpose();
  return row;
}

// The point, and its derivative along both axes, which is scaled so that a frame counts as much as
// a point whatever its size in the images.
bool FillEquations(const AffineCorrespondence& c, Eigen::Matrix<double, 6, 9>* equations, int row) {
  const Eigen::Vector3d x1 = c.frame1.point.homogeneous();
  const Eigen::Vector3d x2 = c.frame2.point.homogeneous();
  const double squared_size = c.frame1.shape.squaredNorm() + c.frame2.shape.squaredNorm();
  if (!(squared_size > 0.0)) return false;
  const double scale = 2.0 / std::sqrt(squared_size);
  equations->row(row) = Bilinear(x1, x2);
  for (int k = 0; k < 2; ++k) {
    const Eigen::Vector3d d1(c.frame1.shape(0, k), c.frame1.shape(1, k), 0.0);
    const Eigen::Vector3d d2(c.frame2.shape(0, k), c.frame2.shape(1, k), 0.0);
    equations->row(row + 1 + k) = scale * (Bilinear(d1, x2) + Bilinear(x1, d2));
  }
  return true;
}

// Six equations, as columns.
using Equations = Eigen::Matrix<double, 9, 6>;
bool FillEquations(const AffineCorrespondence* samples, Equations* columns) {
  Eigen::Matrix<double, 6, 9> rows;
  if (!FillEquations(samples[0], &rows, 0) || !FillEquations(samples[1], &rows, 3)) return false;
  *columns = rows.transpose();
  return rows.squaredNorm() > 0.0;
}

}  // namespace

int TwoAffine::Solve(const Sample* samples, Model* models) {
  Equations equations;
  if (!FillEquations(samples, &equations)) return 0;
  const Eigen::Matrix<double, 9, 3> space = Householder<9, 6>(equations).Complement();
  // E = x X + y Y + W in the last three columns: the monomials without z.
  Eigen::Matrix<double, 9, 4> basis;
  basis << space.col(0), space.col(1), Eigen::Matrix<double, 9, 1>::Zero(), space.col(2);
  internal::ConstraintMatrix constraints;
  internal::EssentialConstraints(basis, &constraints);
  // x3 y3 x2y xy2 x2 y2 xy x y | 1.
  static constexpr int kColumns[9] = {0, 1, 2, 3, 5, 7, 9, 12, 15};
  Eigen::Matrix<double, 10, 9> A;
  for (int k = 0; k < 9; ++k) A.col(k) = constraints.col(kColumns[k]);
  const Eigen::Matrix<double, 9, 1> monomials = Householder<10, 9>(A).Solve(-constraints.col(19));
  const Eigen::Vector4d v = Eigen::Vector4d(monomials[7], monomials[8], 0.0, 1.0).normalized();
  if (!v.allFinite()) return 0;
  const Eigen::Matrix<double, 9, 1> e = std::numbers::sqrt2 * (basis * v);
  models[0] = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(e.data());
  return 1;
}

int TwoAffineFivePoint::Solve(const Sample* samples, Model* models) {
  Equations equations;
  if (!FillEquations(samples, &equations)) return 0;
  return SolveEssentialInSpace(internal::ComplementOfFive(equations), models);
}

}  // namespace cairn
