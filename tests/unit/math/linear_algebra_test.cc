#include <Eigen/LU>
#include <algorithm>

#include "cairn/base/rng.h"
#include "cairn/math/decompositions.h"
#include "math/householder.h"
#include "math/positive_definite.h"
#include "support/test.h"

namespace cairn {
namespace {

template <class Matrix>
Matrix Random(Rng& rng) {
  Matrix M;
  for (Eigen::Index k = 0; k < M.size(); ++k) M(k) = rng.Gaussian();
  return M;
}

TEST(SolvePositive, SolvesByTheLowerTriangle) {
  Rng rng(1);
  for (int i = 0; i < 100; ++i) {
    const auto J = Random<Eigen::Matrix<double, 7, 7>>(rng);
    Eigen::Matrix<double, 7, 7> A = J.transpose() * J;
    const auto x = Random<Eigen::Matrix<double, 7, 1>>(rng);
    const Eigen::Matrix<double, 7, 1> b = A * x;
    A.triangularView<Eigen::StrictlyUpper>().setConstant(std::nan(""));
    Eigen::Matrix<double, 7, 1> solved;
    ASSERT_TRUE(SolvePositive<7>(A, b, &solved));
    EXPECT_LT((J * (solved - x)).norm(), 1e-9);
  }
}

TEST(SolvePositive, RefusesWhatIsNotPositive) {
  Eigen::Vector3d x;
  for (const double last : {0.0, -1.0, std::nan("")}) {
    EXPECT_FALSE(SolvePositive<3>(Eigen::Vector3d(1, 2, last).asDiagonal(), {1, 1, 1}, &x));
  }
  EXPECT_TRUE(SolvePositive<3>(Eigen::Vector3d(1, 2, 1e-9).asDiagonal(), {1, 1, 1}, &x));
  EXPECT_FALSE(SolvePositive<3>(Eigen::Vector3d(1, 2, 1e-9).asDiagonal(), {1, 1, 1}, &x, 1e-6));
}

TEST(Householder, ComplementIsOrthonormalAndOrthogonal) {
  Rng rng(2);
  for (int i = 0; i < 100; ++i) {
    const auto A = Random<Eigen::Matrix<double, 9, 7>>(rng);
    const Eigen::Matrix<double, 9, 2> basis = Householder<9, 7>(A).Complement();
    EXPECT_LT((basis.transpose() * basis - Eigen::Matrix2d::Identity()).norm(), 1e-14);
    EXPECT_LT((A.transpose() * basis).norm(), 1e-13);
  }
  // Dependent columns leave more than the complement asked for.
  const Eigen::Matrix<double, 9, 7> zero = Eigen::Matrix<double, 9, 7>::Zero();
  EXPECT_TRUE((Householder<9, 7>(zero).Complement().allFinite()));
}

TEST(Householder, SolvesLeastSquares) {
  Rng rng(3);
  for (int i = 0; i < 100; ++i) {
    const auto A = Random<Eigen::Matrix<double, 10, 9>>(rng);
    const auto b = Random<Eigen::Matrix<double, 10, 1>>(rng);
    const Eigen::Matrix<double, 9, 1> x = Householder<10, 9>(A).Solve(b);
    EXPECT_LT((A.transpose() * (A * x - b)).norm(), 1e-9 * (1 + x.norm()));
  }
  const Eigen::Matrix<double, 3, 2> dependent = Eigen::Matrix<double, 3, 2>::Ones();
  EXPECT_FALSE((Householder<3, 2>(dependent).Solve({1, 2, 4}).norm() < 1e12));
}

TEST(SingularValues, RebuildTheMatrix) {
  Rng rng(4);
  for (int i = 0; i < 100; ++i) {
    const auto M = Random<Eigen::Matrix3d>(rng);
    const auto [U, V, s] = SingularValues(M);
    EXPECT_LT((U * s.asDiagonal() * V.transpose() - M).norm(), 1e-13);
    EXPECT_GE(s[0], s[1]);
    EXPECT_GE(s[1], s[2]);
    const Svd3 turned = SingularValuesWithRotations(M);
    EXPECT_NEAR(turned.U.determinant(), 1, 1e-13);
    EXPECT_NEAR(turned.V.determinant(), 1, 1e-13);
    EXPECT_LT(
        (turned.U.leftCols<2>() * s.head<2>().asDiagonal() * turned.V.leftCols<2>().transpose() -
         U.leftCols<2>() * s.head<2>().asDiagonal() * V.leftCols<2>().transpose())
            .norm(),
        1e-13);
  }
}

template <int kSize>
void ExpectEigenPairs(Rng& rng) {
  using Matrix = Eigen::Matrix<double, kSize, kSize>;
  const auto M = Random<Matrix>(rng);
  const Matrix A = M + M.transpose();
  const auto [values, vectors] = SymmetricEigen(A);
  EXPECT_LT((vectors * values.asDiagonal() * vectors.transpose() - A).norm(), 1e-13);
  EXPECT_LT((vectors.transpose() * vectors - Matrix::Identity()).norm(), 1e-13);
  EXPECT_TRUE(std::is_sorted(values.begin(), values.end()));
}

TEST(SymmetricEigen, RebuildsTheMatrix) {
  Rng rng(5);
  ExpectEigenPairs<2>(rng);
  ExpectEigenPairs<3>(rng);
  ExpectEigenPairs<5>(rng);
}

TEST(LeastEigenvector, IsTheNullVectorWhereThereIsOne) {
  Rng rng(6);
  const auto J = Random<Eigen::Matrix<double, 8, 9>>(rng);
  Eigen::Matrix<double, 9, 1> x;
  ASSERT_TRUE(LeastEigenvector(J.transpose() * J, &x));
  EXPECT_NEAR(x.norm(), 1, 1e-14);
  EXPECT_LT((J * x).norm(), 1e-12);
  EXPECT_FALSE(LeastEigenvector(Eigen::Matrix<double, 9, 9>::Constant(std::nan("")), &x));
}

}  // namespace
}  // namespace cairn
