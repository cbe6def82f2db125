#pragma once

#include <Eigen/Core>

namespace cairn {

// Decompositions of small matrices, compiled once: Eigen's templates take seconds wherever they are
// used.

// M = U diag(s) V^T with orthogonal U and V and s descending.
struct Svd3 {
  Eigen::Matrix3d U, V;
  Eigen::Vector3d s;
};
Svd3 SingularValues(const Eigen::Matrix3d& M);
// The same with rotations for U and V: their third columns may be turned, the product then being
// M up to the sign of its third part.
Svd3 SingularValuesWithRotations(const Eigen::Matrix3d& M);

// Eigenvalues, ascending, and orthonormal eigenvectors, as columns, of a symmetric matrix (its
// lower triangle) of 2, 3 or 5 rows.
template <int kSize>
struct EigenPairs {
  Eigen::Matrix<double, kSize, 1> values;
  Eigen::Matrix<double, kSize, kSize> vectors;
};
template <int kSize>
EigenPairs<kSize> SymmetricEigen(const Eigen::Matrix<double, kSize, kSize>& A);

// The unit vector x with the least x^T A x of a symmetric matrix (its lower triangle). False if A
// is not finite.
bool LeastEigenvector(const Eigen::Matrix<double, 9, 9>& A, Eigen::Matrix<double, 9, 1>* x);

}  // namespace cairn
