#include "cairn/solvers/seven_point.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "cairn/solvers/polynomial.h"
#include "math/householder.h"

namespace cairn {

int SevenPoint::Solve(const Sample* samples, Model* models) {
  Eigen::Matrix<double, 9, 7> equations;
  for (int i = 0; i < 7; ++i) {
    const double x1 = samples[i].x1.x(), y1 = samples[i].x1.y();
    const double x2 = samples[i].x2.x(), y2 = samples[i].x2.y();
    equations.col(i) << x2 * x1, x2 * y1, x2, y2 * x1, y2 * y1, y2, x1, y1, 1.0;
  }
  const Eigen::Matrix<double, 9, 2> basis = Householder<9, 7>(equations).Complement();
  using RowMajor3d = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
  const Eigen::Matrix3d F1 = Eigen::Map<const RowMajor3d>(basis.col(0).data());
  const Eigen::Matrix3d F2 = Eigen::Map<const RowMajor3d>(basis.col(1).data());

  // det(a F1 + F2) is a cubic in a, of which the mixed terms are sums of mixed determinants.
  auto mixed = [](const Eigen::Matrix3d& A, const Eigen::Matrix3d& B) {
    double sum = 0.0;  // derivative of det at A in the direction B
    for (int k = 0; k < 3; ++k) {
      Eigen::Matrix3d M = A;
      M.row(k) = B.row(k);
      sum += M.determinant();
    }
    return sum;
  };
  const double cubic[4] = {F2.determinant(), mixed(F2, F1), mixed(F1, F2), F1.determinant()};
  double roots[3];
  const int num_roots = RealRoots(cubic, 3, roots);
  for (int i = 0; i < num_roots; ++i) {
    models[i] = (roots[i] * F1 + F2).normalized();
  }
  return num_roots;
}

}  // namespace cairn
