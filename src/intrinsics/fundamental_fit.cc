#include "intrinsics/fundamental_fit.h"

#include <Eigen/LU>
#include <cmath>
#include <span>
#include <vector>

#include "cairn/math/median.h"
#include "math/positive_definite.h"
#include "robust/fundamental_refinement.h"
#include "robust/match_errors.h"

namespace cairn::internal {
namespace {

constexpr double kMinScalePx = 0.3;  // of the robust loss

double MedianSigma(const PointPairs& points, const Eigen::Matrix3d& F) {
  const MatchErrors all(points, F);
  const std::span<const float> errors = all.values();
  return UpperMedian(std::vector<double>(errors.begin(), errors.end())) / kNormalMedian;
}

// What the noise of the matches does, by the inverse Hessian, and what leaving out a tenth of them
// does (jackknife; Efron, "The jackknife, the bootstrap and other resampling plans", 1982): where a
// plane holds most matches, a few others, right or wrong, decide, and only the latter shows it.
// False where no covariance comes of it.
bool SetCovariance(const PointPairs& points, FundamentalFit* fit) {
  constexpr int kGroups = 10;
  constexpr int kDof = FundamentalFit::kDof;
  using Matrix = NormalEquations<kDof>::Matrix;
  using Vector = NormalEquations<kDof>::Vector;
  const FundamentalFit::Tangents tangents = fit->ByStep();
  const double scale_px = LossScalePx(fit->sigma_px);
  // The normal equations are in units of the squared scale.
  const double variance = std::pow(fit->sigma_px / scale_px, 2);
  NormalEquations<kDof> groups[kGroups];
  // Directions that no match sees get a standard deviation of 1, not an infinite one.
  Matrix H = variance * Matrix::Identity();
  for (int k = 0; k < kGroups; ++k) {
    groups[k] = LinearizeFundamental(points, fit->F(), scale_px, k, kGroups).Along<kDof>(tangents);
    H += groups[k].hessian;
  }
  for (int k = 0; k < kDof; ++k) {
    Vector column;
    if (!SolvePositive<kDof>(H, variance * Vector::Unit(k), &column)) return false;
    fit->covariance.col(k) = column;
  }
  fit->covariance_of_noise = fit->covariance;
  for (int k = 0; k < kGroups; ++k) {
    Vector shift;
    if (!SolvePositive<kDof>(H - groups[k].hessian, groups[k].gradient, &shift)) return false;
    fit->covariance += (kGroups - 1.0) / kGroups * shift * shift.transpose();
  }
  return fit->covariance.allFinite();
}

}  // namespace

double LossScalePx(double sigma_px) { return std::max(kMinScalePx, 3 * sigma_px); }

std::optional<FundamentalFit> FitFundamental(const PointPairs& points,
                                             const Eigen::Matrix3d& start) {
  constexpr double kMinRatio = 1e-6;  // of singular values: of rank 1 below
  constexpr int kMaxRounds = 5;
  constexpr double kSameScale = 0.01;
  if (points.size() < kMinFundamentalMatches) return std::nullopt;
  const std::optional<FundamentalFactors> factors = FundamentalFactors::Of(start);
  if (!factors || !(factors->B(1, 1) > kMinRatio * factors->B(0, 0))) return std::nullopt;
  FundamentalFit fit;
  static_cast<FundamentalFactors&>(fit) = *factors;
  fit.sigma_px = MedianSigma(points, fit.F());
  for (int round = 0; round < kMaxRounds; ++round) {
    const double scale_px = LossScalePx(fit.sigma_px);
    static_cast<FundamentalFactors&>(fit) =
        RefineFundamentalMatrix(points, fit.F(), {.scale_px = scale_px, .min_relative_gain = 1e-9});
    fit.sigma_px = MedianSigma(points, fit.F());
    if (std::abs(LossScalePx(fit.sigma_px) - scale_px) < kSameScale * scale_px) break;
  }
  if (!(fit.B.determinant() > 0)) return std::nullopt;
  fit.sigma_px = std::max(kMinSigmaPx, fit.sigma_px);
  if (!SetCovariance(points, &fit)) return std::nullopt;
  return fit;
}

}  // namespace cairn::internal
