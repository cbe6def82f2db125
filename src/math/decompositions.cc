#include "cairn/math/decompositions.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <type_traits>

namespace cairn {
namespace {

// Eigen has a solver of its own for three rows. All other sizes share one, to the same bits: each
// would take ten seconds to compile.
template <int kSize>
using EigenSolver = Eigen::SelfAdjointEigenSolver<std::conditional_t<
    kSize == 3, Eigen::Matrix3d, Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 9, 9>>>;

}  // namespace

Svd3 SingularValues(const Eigen::Matrix3d& M) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {svd.matrixU(), svd.matrixV(), svd.singularValues()};
}

Svd3 SingularValuesWithRotations(const Eigen::Matrix3d& M) {
  Svd3 svd = SingularValues(M);
  if (svd.U.determinant() < 0.0) svd.U.col(2) *= -1.0;
  if (svd.V.determinant() < 0.0) svd.V.col(2) *= -1.0;
  return svd;
}

template <int kSize>
EigenPairs<kSize> SymmetricEigen(const Eigen::Matrix<double, kSize, kSize>& A) {
  const EigenSolver<kSize> eigen(A);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}
template EigenPairs<2> SymmetricEigen(const Eigen::Matrix2d& A);
template EigenPairs<3> SymmetricEigen(const Eigen::Matrix3d& A);
template EigenPairs<5> SymmetricEigen(const Eigen::Matrix<double, 5, 5>& A);

bool LeastEigenvector(const Eigen::Matrix<double, 9, 9>& A, Eigen::Matrix<double, 9, 1>* x) {
  const EigenSolver<9> eigen(A);
  if (eigen.info() != Eigen::Success || !eigen.eigenvalues().allFinite()) return false;
  *x = eigen.eigenvectors().col(0);
  return true;
}

}  // namespace cairn
