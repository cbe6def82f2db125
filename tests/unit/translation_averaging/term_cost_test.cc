#include "translation_averaging/term_cost.h"

#include <gmock/gmock.h>

#include <cmath>

#include "cairn/base/rng.h"
#include "cairn/synthetic/poses.h"

namespace cairn {
namespace {

constexpr double kStep = 1e-6;

template <class Cost>
Eigen::Vector3d NumericGradient(const Cost& cost, const Eigen::Vector3d& D) {
  Eigen::Vector3d gradient;
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d h = kStep * Eigen::Vector3d::Unit(k);
    gradient[k] = (cost(D + h) - cost(D - h)) / (2 * kStep);
  }
  return gradient;
}

TEST(TermCost, HuberIsQuadraticThenLinear) {
  EXPECT_DOUBLE_EQ(HuberCost(0.5, 1), 0.125);
  EXPECT_DOUBLE_EQ(HuberCost(3, 1), 2.5);
  EXPECT_DOUBLE_EQ(HuberWeight(0.5, 1), 1);
  EXPECT_DOUBLE_EQ(HuberWeight(4, 1), 0.25);
}

TEST(TermCost, GradientsEqualCentralDifferences) {
  Rng rng(1);
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Vector3d v = RandomDirection(rng);
    const Eigen::Vector3d D = rng.Uniform(0.5, 3) * RandomDirection(rng);
    const double s = rng.Uniform(0.1, 2);
    const double huber = trial % 2 == 0 ? 0.3 : 10.0;
    const auto chordal = [&](const Eigen::Vector3d& x) { return ChordalCost(v, x, huber); };
    EXPECT_LT((ChordalModel(v, D, huber).gradient - NumericGradient(chordal, D)).norm(), 1e-8);
    // With endless damping the scale stands still.
    const auto scale_free = [&](const Eigen::Vector3d& x) { return ScaleFreeCost(v, x, s, huber); };
    const TermModel model = ScaleFreeModel(v, D, s, huber, 1e12);
    EXPECT_LT((model.gradient - NumericGradient(scale_free, D)).norm(), 1e-8);
  }
}

// Where it fits, Gauss-Newton's curvature is the Hessian.
TEST(TermCost, CurvatureIsTheHessianAtAPerfectFit) {
  Rng rng(2);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Vector3d D = rng.Uniform(0.5, 3) * RandomDirection(rng);
    const Eigen::Vector3d v = D.normalized();
    const Eigen::Matrix3d chordal = ChordalModel(v, D, 1).curvature;
    const Eigen::Matrix3d scale_free = ScaleFreeModel(v, D, 1 / D.norm(), 1, 0).curvature;
    Eigen::Matrix3d numeric;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d h = kStep * Eigen::Vector3d::Unit(k);
      numeric.col(k) =
          (ChordalModel(v, D + h, 1).gradient - ChordalModel(v, D - h, 1).gradient) / (2 * kStep);
    }
    EXPECT_LT((chordal - numeric).norm(), 1e-6);
    EXPECT_LT((scale_free - numeric).norm(), 1e-6);
  }
}

TEST(TermCost, ScaleFollowsItsNewtonStepAndStaysPositive) {
  const Eigen::Vector3d v(0, 0, 1), D(0.3, 0, 2), zero(0, 0, 0);
  const double best = BestScale(v, D);
  EXPECT_NEAR(best, v.dot(D) / D.squaredNorm(), 1e-15);
  EXPECT_NEAR(ScaleFreeUpdate(v, D, 0.1, zero, 0), best, 1e-15);
  EXPECT_LT(ScaleFreeCost(v, D, best, 1), ScaleFreeCost(v, D, 1.01 * best, 1));
  EXPECT_GT(BestScale(v, -D), 0);
  EXPECT_GT(ScaleFreeUpdate(v, -D, 0.1, zero, 0), 0);
}

}  // namespace
}  // namespace cairn
