#include "cairn/math/so3.h"

#include <Eigen/LU>
#include <cmath>
#include <numbers>

#include "cairn/base/rng.h"
#include "cairn/math/angles.h"
#include "support/test.h"

namespace cairn {
namespace {

Eigen::Vector3d RandomVector(Rng& rng) { return {rng.Gaussian(), rng.Gaussian(), rng.Gaussian()}; }

TEST(Angles, DegreesAndRadians) {
  EXPECT_DOUBLE_EQ(DegToRad(180), std::numbers::pi);
  EXPECT_DOUBLE_EQ(RadToDeg(DegToRad(12.5)), 12.5);
}

TEST(SO3, CrossMatrixIsTheCrossProduct) {
  Rng rng(1);
  const Eigen::Vector3d a = RandomVector(rng), b = RandomVector(rng);
  EXPECT_LT((CrossMatrix(a) * b - a.cross(b)).norm(), 1e-15);
}

TEST(SO3, ExpTurnsRightHanded) {
  const Eigen::Vector3d x = ExpSO3({0, 0, 0.5 * std::numbers::pi}) * Eigen::Vector3d(1, 0, 0);
  EXPECT_LT((x - Eigen::Vector3d(0, 1, 0)).norm(), 1e-15);
}

TEST(SO3, LogInvertsExpAtAllAngles) {
  Rng rng(2);
  for (const double angle :
       {0.0, 1e-300, 1e-12, 1e-9, 1e-6, 0.99e-4, 1.01e-4, 0.1, 1.0, 3.0, std::numbers::pi - 1e-7}) {
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d w = angle * RandomVector(rng).normalized();
      const Eigen::Quaterniond q = ExpSO3(w);
      EXPECT_NEAR(q.norm(), 1, 1e-15);
      EXPECT_LT((LogSO3(q) - w).norm(), 1e-15 + 4e-15 * angle) << angle;
      const Eigen::Quaterniond negative(-q.w(), -q.x(), -q.y(), -q.z());  // the same rotation
      EXPECT_LT((LogSO3(negative) - w).norm(), 1e-15 + 4e-15 * angle);
    }
  }
  EXPECT_NEAR(LogSO3(ExpSO3({0, std::numbers::pi, 0})).norm(), std::numbers::pi, 1e-14);
  // Beyond pi the shorter way round is returned.
  EXPECT_LT((LogSO3(ExpSO3({4, 0, 0})) - Eigen::Vector3d(4 - 2 * std::numbers::pi, 0, 0)).norm(),
            1e-14);
}

TEST(SO3, NearestRotationIsARotationAndNearest) {
  Rng rng(3);
  for (int i = 0; i < 200; ++i) {
    Eigen::Matrix3d M;
    for (int k = 0; k < 9; ++k) M(k) = rng.Gaussian();
    const Eigen::Matrix3d R = NearestRotation(M);
    EXPECT_LT((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-13);
    EXPECT_NEAR(R.determinant(), 1, 1e-13);
    for (int k = 0; k < 5; ++k) {
      const Eigen::Matrix3d other = ExpSO3(0.05 * RandomVector(rng)).toRotationMatrix() * R;
      EXPECT_LE((R - M).norm(), (other - M).norm() + 1e-12);
    }
    EXPECT_LT((NearestRotation(2.5 * R) - R).norm(), 1e-13);
  }
}

}  // namespace
}  // namespace cairn
