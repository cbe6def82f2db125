#include "intrinsics/essential_term.h"

#include <cmath>
#include <limits>

#include "cairn/math/decompositions.h"
#include "cairn/math/so3.h"
#include "intrinsics/fundamental_fit.h"
#include "intrinsics/kruppa.h"
#include "support/test.h"
#include "unit/intrinsics/focal_rig.h"

namespace cairn {
namespace {

// What a pair of images says of intrinsics: by its F (Kruppa's equations), and by its matches.
PointPairs RaysOf(const FocalPair& pair, double nominal_px) {
  const Eigen::Vector2d center(0.5 * kFocalTestWidth, 0.5 * kFocalTestHeight);
  PointPairs points;
  points.Reset(static_cast<int>(pair.pixels1.size()), nominal_px, nominal_px);
  for (int i = 0; i < points.size(); ++i) {
    points.Set(i, (pair.pixels1[i] - center) / nominal_px, (pair.pixels2[i] - center) / nominal_px);
  }
  return points;
}

internal::FundamentalFit FitOf(const FocalPair& pair, double nominal_px) {
  const Eigen::Matrix3d K = GuessedCamera(1, nominal_px).CalibrationMatrix();
  return *internal::FitFundamental(RaysOf(pair, nominal_px), K.transpose() * pair.F * K);
}

TEST(Kruppa, VanishesAtTheTruthAlone) {
  Rig rig({1000, 1400}, 4);
  const internal::FundamentalFit fit = FitOf(rig.MakePair(0, 1, 0), 1000);
  EXPECT_LT(internal::KruppaEquations(fit, {0, std::log(1.4)}).Residual().norm(), 1e-6);
  EXPECT_GT(internal::KruppaEquations(fit, {0.1, std::log(1.4)}).Residual().norm(), 1e-3);
  EXPECT_GT(internal::KruppaEquations(fit, {0, 0}).Residual().norm(), 1e-3);
  // The length is that of the singular values.
  const Eigen::Matrix3d E = Eigen::Vector3d(1.2, 1.2, 1).asDiagonal() * fit.F();
  const Eigen::Vector3d s = SingularValues(E).s;
  EXPECT_NEAR(internal::KruppaEquations(fit, {0, std::log(1.2)}).Residual().norm(),
              (s[0] - s[1]) / (s[0] + s[1]), 1e-9);
}

TEST(Kruppa, JacobianAndCovarianceMatchDifferences) {
  Rig rig({1000, 1400}, 4);
  const internal::FundamentalFit fit = FitOf(rig.MakePair(0, 1), 1000);
  const Eigen::Vector2d at(0.15, -0.1);
  const double h = 1e-6;
  const Eigen::Vector4d points(0.02, -0.01, 0.03, 0.015);
  const internal::KruppaEquations equations(fit, at, points);
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector4d step = h * Eigen::Vector4d::Unit(k);
    const Eigen::Vector2d difference =
        (internal::KruppaEquations(fit, at, points + step).Residual() -
         internal::KruppaEquations(fit, at, points - step).Residual()) /
        (2 * h);
    EXPECT_LT((equations.ByPrincipalPoints().col(k) - difference).norm(), 1e-7);
  }
  // Along the directions of the fit.
  Eigen::Matrix<double, 2, 7> by_fit;
  for (int k = 0; k < 7; ++k) {
    Eigen::Vector2d values[2];
    for (const int sign : {-1, 1}) {
      internal::FundamentalFit moved = fit;
      const Eigen::Vector3d turn = sign * h * Eigen::Vector3d::Unit(k % 2);
      if (k < 2) moved.U = fit.U * ExpSO3(turn).toRotationMatrix();
      if (k == 2 || k == 3) moved.V = fit.V * ExpSO3(turn).toRotationMatrix();
      if (k >= 4) moved.B += sign * h * fit.Direction(k - 4);
      values[sign > 0] = internal::KruppaEquations(moved, at, points).Residual();
    }
    by_fit.col(k) = (values[1] - values[0]) / (2 * h);
  }
  const Eigen::Matrix2d expected = by_fit * fit.covariance * by_fit.transpose();
  const Eigen::Matrix2d covariance = equations.Covariance();
  EXPECT_LT((covariance - expected).norm(), 1e-4 * expected.norm());
}

TEST(FundamentalFit, FindsTheMatrixAndKnowsHowSureItIs) {
  Rig rig({1000}, 4);
  const Eigen::Matrix3d K = rig.truth.at(1).CalibrationMatrix();
  const FocalPair pair = rig.MakePair(0, 1, 0.5);
  Eigen::Matrix3d exact = (K.transpose() * pair.F * K).normalized();
  int num_within = 0;
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero(), predicted = Eigen::Matrix2d::Zero();
  for (int k = 0; k < 60; ++k) {
    const internal::FundamentalFit fit = FitOf(rig.MakePair(0, 1, 0.5), 1000);
    EXPECT_LT((fit.U.transpose() * fit.U - Eigen::Matrix3d::Identity()).norm(), 1e-9);
    EXPECT_NEAR(fit.sigma_px, 0.5, 0.2);
    const double sign = fit.F().cwiseProduct(exact).sum() > 0 ? 1 : -1;
    num_within += (sign * fit.F() - exact).norm() < 0.05;
    const internal::KruppaEquations equations(fit, {0, 0});
    const Eigen::Vector2d r = equations.Residual();
    spread += r * r.transpose() / 60;
    predicted += equations.Covariance() / 60;
  }
  EXPECT_EQ(num_within, 60);
  // Noise and jackknife together: twice the variance that there is.
  EXPECT_GT(predicted.trace(), spread.trace());
  EXPECT_LT(predicted.trace(), 6 * spread.trace());
  for (int a = 0; a < 3; ++a) {
    const internal::FundamentalFit fit = FitOf(pair, 1000);
    EXPECT_NEAR(fit.Direction(a).norm(), 1, 1e-12);
    EXPECT_NEAR(fit.Direction(a).cwiseProduct(fit.B).sum(), 0, 1e-12);
    for (int b = 0; b < a; ++b) {
      EXPECT_NEAR(fit.Direction(a).cwiseProduct(fit.Direction(b)).sum(), 0, 1e-12);
    }
  }
}

TEST(FundamentalFit, RefusesTooFewMatchesAndNonsense) {
  Rig rig({1000}, 2);
  FocalPair pair = rig.MakePair(0, 1);
  const auto fits = [&](const Eigen::Matrix3d& start) {
    return internal::FitFundamental(RaysOf(pair, 1000), start).has_value();
  };
  EXPECT_TRUE(fits(pair.F));
  EXPECT_FALSE(fits(Eigen::Matrix3d::Zero()));
  EXPECT_FALSE(fits(Eigen::Matrix3d::Constant(std::nan(""))));
  pair.pixels1.resize(14);
  pair.pixels2.resize(14);
  EXPECT_FALSE(fits(pair.F));
}

internal::EssentialTerm TermOf(const PointPairs& points, const internal::FundamentalFit& fit,
                               const internal::EssentialTerm::Intrinsics& at) {
  return {points, fit, Eigen::Vector2d(0.1, 0.1), at};
}

TEST(EssentialTerm, CostsNothingWhereIntrinsicsAreRight) {
  Rig rig({1000, 1400}, 4);
  const FocalPair pair = rig.MakePair(0, 1, 0);
  const PointPairs points = RaysOf(pair, 1000);
  const internal::FundamentalFit fit = FitOf(pair, 1000);
  internal::EssentialTerm::Intrinsics at = internal::EssentialTerm::Intrinsics::Zero();
  at[3] = std::log(1.4);
  EXPECT_LT(TermOf(points, fit, at).Reduce(at).cost, 0.1);
  for (int k = 0; k < 6; ++k) {
    internal::EssentialTerm::Intrinsics off = at;
    off[k] += k % 3 == 0 ? 0.1 : 1;
    EXPECT_GT(TermOf(points, fit, off).Reduce(off).cost, 10) << k;
  }
  // E is found from wherever it was before.
  internal::EssentialTerm term = TermOf(points, fit, at);
  internal::EssentialTerm::Intrinsics off = at;
  off[0] = -0.3;
  EXPECT_GT(term.Reduce(off).cost, 10);
  EXPECT_LT(term.Reduce(at).cost, 0.1);
}

TEST(EssentialTerm, DerivativesMatchDifferences) {
  Rig rig({1000, 1400}, 4);
  const FocalPair pair = rig.MakePair(0, 1, 0.5);
  const PointPairs points = RaysOf(pair, 1000);
  const internal::FundamentalFit fit = FitOf(pair, 1000);
  internal::EssentialTerm::Intrinsics at;
  at << 0.05, 0.1, -0.2, 0.3, 0.15, 0.1;
  internal::EssentialTerm term = TermOf(points, fit, at);
  const auto reduced = term.Reduce(at);
  constexpr double kStep = 1e-3;
  for (int k = 0; k < 6; ++k) {
    internal::EssentialTerm::Intrinsics more = at, less = at;
    more[k] += kStep;
    less[k] -= kStep;
    const double by = (term.Reduce(more).cost - term.Reduce(less).cost) / (2 * kStep);
    EXPECT_NEAR(2 * reduced.gradient[k], by, 0.02 * reduced.gradient.norm()) << k;
  }
}

}  // namespace
}  // namespace cairn
