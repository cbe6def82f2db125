#include "translation_averaging/term_cost.h"

#include <cmath>

#include "cairn/base/rng.h"
#include "cairn/synthetic/poses.h"
#include "support/test.h"

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
    const Eigen::Vector3d D = RandomOfLength(0.5, 3, rng);
    const double huber = trial % 2 == 0 ? 0.3 : 10.0;
    const auto chordal = [&](const Eigen::Vector3d& x) { return ChordalCost(v, x, huber); };
    EXPECT_LT((ChordalModel(v, D, huber).gradient - NumericGradient(chordal, D)).norm(), 1e-8);
  }
}

// Where it fits, Gauss-Newton's curvature is the Hessian.
TEST(TermCost, CurvatureIsTheHessianAtAPerfectFit) {
  Rng rng(2);
  for (int trial = 0; trial < 100; ++trial) {
    const Eigen::Vector3d D = RandomOfLength(0.5, 3, rng);
    const Eigen::Vector3d v = D.normalized();
    const Eigen::Matrix3d chordal = ChordalModel(v, D, 1).Curvature();
    Eigen::Matrix3d numeric;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d h = kStep * Eigen::Vector3d::Unit(k);
      numeric.col(k) =
          (ChordalModel(v, D + h, 1).gradient - ChordalModel(v, D - h, 1).gradient) / (2 * kStep);
    }
    EXPECT_LT((chordal - numeric).norm(), 1e-6);
  }
}

}  // namespace
}  // namespace cairn
