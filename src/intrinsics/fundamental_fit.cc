#include "intrinsics/fundamental_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>
#include <vector>

#include "cairn/math/median.h"
#include "cairn/math/so3.h"

namespace cairn::internal {
namespace {

constexpr size_t kMinMatches = 15;
constexpr int kMaxFitIterations = 30;
constexpr double kMinScalePx = 0.3;      // of the robust loss
constexpr double kMinFitSigmaPx = 0.05;  // no detector is more exact
// The median of |e| of a normal distribution, in standard deviations.
constexpr double kFitNormalMedian = 0.6745;

using Vector9 = Eigen::Matrix<double, 9, 1>;
using Matrix9 = Eigen::Matrix<double, 9, 9>;
using Vector7 = FundamentalStep;
using Matrix7 = Eigen::Matrix<double, FundamentalFit::kDof, FundamentalFit::kDof>;
using Matrix97 = FundamentalTangents;
Vector9 Vec(const Eigen::Matrix3d& M) { return Eigen::Map<const Vector9>(M.data()); }

// The signed Sampson errors and, as rows that F's entries multiply, what they are linear in while
// the denominator is held.
class SampsonRows {
 public:
  SampsonRows(std::span<const Eigen::Vector2d> x1, std::span<const Eigen::Vector2d> x2,
              double focal1_px, double focal2_px)
      : x1_(x1), x2_(x2), inverse1_(1 / focal1_px), inverse2_(1 / focal2_px) {}

  void Evaluate(const Eigen::Matrix3d& F, std::vector<double>* errors,
                std::vector<double>* precisions) const {
    errors->clear();
    precisions->clear();
    for (size_t i = 0; i < x1_.size(); ++i) {
      const Eigen::Vector3d line2 = F * x1_[i].homogeneous();
      const Eigen::Vector3d line1 = F.transpose() * x2_[i].homogeneous();
      const double length =
          std::hypot(line2.head<2>().norm() * inverse2_, line1.head<2>().norm() * inverse1_);
      precisions->push_back(1 / std::max(length, 1e-300));
      errors->push_back(x2_[i].homogeneous().dot(line2) * precisions->back());
    }
  }

  // Sum of weight row row^T and of weight error row, over every `step`th match from `begin` on.
  void Accumulate(const std::vector<double>& errors, const std::vector<double>& precisions,
                  double scale_px, Matrix9* moments, Vector9* gradient, size_t begin = 0,
                  size_t step = 1) const {
    moments->setZero();
    gradient->setZero();
    for (size_t i = begin; i < x1_.size(); i += step) {
      const double s2 = scale_px * scale_px;
      const double weight = s2 / (s2 + errors[i] * errors[i]);
      const Eigen::Vector3d h1 = x1_[i].homogeneous(), h2 = x2_[i].homogeneous();
      const Eigen::Matrix3d outer = h2 * h1.transpose();
      const Vector9 row = precisions[i] * Vec(outer);
      // Geman-McClure: the derivative of e^2 s^2 / (s^2 + e^2) by e^2.
      moments->selfadjointView<Eigen::Lower>().rankUpdate(row, weight * weight);
      *gradient += weight * weight * errors[i] * row;
    }
    *moments = moments->selfadjointView<Eigen::Lower>();
  }

 private:
  std::span<const Eigen::Vector2d> x1_, x2_;
  double inverse1_, inverse2_;
};

double RobustCost(const std::vector<double>& errors, double scale_px) {
  const double s2 = scale_px * scale_px;
  double cost = 0;
  for (const double e : errors) cost += e * e * s2 / (s2 + e * e);
  return cost;
}

double MedianSigma(const std::vector<double>& errors) {
  std::vector<double> lengths;
  for (const double e : errors) lengths.push_back(std::abs(e));
  return UpperMedian(std::move(lengths)) / kFitNormalMedian;
}

// What the noise of the matches does, by the inverse Hessian, and what leaving out a tenth of them
// does (jackknife; Efron, "The jackknife, the bootstrap and other resampling plans", 1982): where a
// plane holds most matches, a few others, right or wrong, decide, and only the latter shows it.
Matrix7 Covariance(const SampsonRows& rows, const std::vector<double>& errors,
                   const std::vector<double>& precisions, const FundamentalFit& fit) {
  constexpr size_t kGroups = 10;
  const Matrix97 tangents = Tangents(fit);
  const double scale_px = std::max(kMinScalePx, 3 * fit.sigma_px);
  const double variance = fit.sigma_px * fit.sigma_px;
  Matrix9 moments;
  Vector9 gradient;
  Matrix7 H_of[kGroups];
  Vector7 gradient_of[kGroups];
  // Directions that no match sees get a standard deviation of 1, not an infinite one.
  Matrix7 H = variance * Matrix7::Identity();
  for (size_t k = 0; k < kGroups; ++k) {
    rows.Accumulate(errors, precisions, scale_px, &moments, &gradient, k, kGroups);
    H_of[k] = tangents.transpose() * moments * tangents;
    gradient_of[k] = tangents.transpose() * gradient;
    H += H_of[k];
  }
  Matrix7 covariance = variance * H.inverse();
  for (size_t k = 0; k < kGroups; ++k) {
    const Vector7 shift = (H - H_of[k]).ldlt().solve(gradient_of[k]);
    covariance += (kGroups - 1.0) / kGroups * shift * shift.transpose();
  }
  return covariance;
}

}  // namespace

FundamentalTangents Tangents(const FundamentalFit& fit) {
  Eigen::Matrix3d middle = Eigen::Matrix3d::Zero();
  middle.topLeftCorner<2, 2>() = fit.B;
  FundamentalTangents tangents;
  for (int k = 0; k < 2; ++k) {
    const Eigen::Matrix3d W = CrossMatrix(Eigen::Vector3d::Unit(k));
    tangents.col(k) = Vec(fit.U * W * middle * fit.V.transpose());
    tangents.col(2 + k) = Vec(-fit.U * middle * W * fit.V.transpose());
  }
  for (int k = 0; k < 3; ++k) {
    tangents.col(4 + k) =
        Vec(fit.U.leftCols<2>() * fit.Direction(k) * fit.V.leftCols<2>().transpose());
  }
  return tangents;
}

FundamentalFit Moved(const FundamentalFit& fit, const FundamentalStep& step) {
  FundamentalFit moved = fit;
  moved.U = fit.U * ExpSO3({step[0], step[1], 0}).toRotationMatrix();
  moved.V = fit.V * ExpSO3({step[2], step[3], 0}).toRotationMatrix();
  for (int k = 0; k < 3; ++k) moved.B += step[4 + k] * fit.Direction(k);
  moved.B.normalize();
  return moved;
}

std::optional<FundamentalFit> DecomposeFundamental(const Eigen::Matrix3d& F) {
  if (!F.allFinite()) return std::nullopt;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (!(svd.singularValues()[1] > 1e-6 * svd.singularValues()[0])) return std::nullopt;
  FundamentalFit fit;
  fit.U = svd.matrixU();
  fit.V = svd.matrixV();
  // The third columns do not matter, so they can make rotations of both.
  if (fit.U.determinant() < 0) fit.U.col(2) *= -1;
  if (fit.V.determinant() < 0) fit.V.col(2) *= -1;
  fit.B = svd.singularValues().head<2>().normalized().asDiagonal();
  return fit;
}

Eigen::Matrix2d FundamentalFit::Direction(int k) const {
  // Products of B, as a quaternion, with the three units are orthogonal to it and to each other.
  const double a = B(0, 0), b = B(1, 0), c = B(0, 1), d = B(1, 1);
  Eigen::Matrix2d N;
  if (k == 0) N << -b, -d, a, c;
  if (k == 1) N << -c, a, d, -b;
  if (k == 2) N << -d, b, -c, a;
  return N;
}

std::optional<FundamentalFit> FitFundamental(std::span<const Eigen::Vector2d> x1,
                                             std::span<const Eigen::Vector2d> x2, double focal1_px,
                                             double focal2_px, const Eigen::Matrix3d& start) {
  if (x1.size() < kMinMatches) return std::nullopt;
  std::optional<FundamentalFit> fit = DecomposeFundamental(start);
  if (!fit) return std::nullopt;
  const SampsonRows rows(x1, x2, focal1_px, focal2_px);
  std::vector<double> errors, precisions, new_errors, new_precisions;
  rows.Evaluate(fit->F(), &errors, &precisions);
  double damping = 1e-3;
  Matrix9 moments;
  Vector9 gradient;
  for (int i = 0; i < kMaxFitIterations; ++i) {
    const double scale_px = std::max(kMinScalePx, 3 * MedianSigma(errors));
    const double cost = RobustCost(errors, scale_px);
    const Matrix97 tangents = Tangents(*fit);
    rows.Accumulate(errors, precisions, scale_px, &moments, &gradient);
    const Matrix7 H = tangents.transpose() * moments * tangents;
    Matrix7 damped = H;
    damped.diagonal() += damping * (H.diagonal() + Vector7::Constant(1e-12 * H.trace()));
    const Vector7 step = -damped.ldlt().solve(Vector7(tangents.transpose() * gradient));
    if (!step.allFinite()) return std::nullopt;
    const FundamentalFit moved = Moved(*fit, step);
    rows.Evaluate(moved.F(), &new_errors, &new_precisions);
    const double gain = cost - RobustCost(new_errors, scale_px);
    if (gain > 0) {
      *fit = moved;
      errors.swap(new_errors);
      precisions.swap(new_precisions);
      damping = std::max(1e-9, 0.2 * damping);
    } else {
      damping *= 10;
    }
    if (std::abs(gain) < 1e-9 * cost || damping > 1e6) break;
  }
  if (!(fit->B.determinant() > 0)) return std::nullopt;
  fit->sigma_px = std::max(kMinFitSigmaPx, MedianSigma(errors));
  fit->covariance = Covariance(rows, errors, precisions, *fit);
  if (!fit->covariance.allFinite()) return std::nullopt;
  return fit;
}

}  // namespace cairn::internal
