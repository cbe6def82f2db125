#include "intrinsics/essential_term.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "math/levenberg_marquardt.h"
#include "robust/fundamental_refinement.h"

namespace cairn::internal {
namespace {

constexpr int kDofOfE = 5;  // the first of FundamentalFactors: what is left turns E into no other
constexpr int kMaxSteps = 10;
constexpr double kMinGain = 1e-4;

// K^-1, and its changes with log focal length and principal point, which is in its sigmas.
struct InverseK {
  InverseK(const Eigen::Vector3d& intrinsics, double principal_point_sigma) {
    const double inverse = std::exp(-intrinsics[0]), shift = inverse * principal_point_sigma;
    value << inverse, 0, -shift * intrinsics[1], 0, inverse, -shift * intrinsics[2], 0, 0, 1;
    by[0] = -value;
    by[0](2, 2) = 0;
    by[1] = by[2] = Eigen::Matrix3d::Zero();
    by[1](0, 2) = by[2](1, 2) = -shift;
  }
  Eigen::Matrix3d value;
  Eigen::Matrix3d by[3];
};

using Vector9 = Eigen::Matrix<double, 9, 1>;
Vector9 Stacked(const Eigen::Matrix3d& M) { return Eigen::Map<const Vector9>(M.data()); }

Eigen::Matrix<double, 9, kDofOfE> ByStep(const FundamentalFactors& E, const InverseK& K1,
                                         const InverseK& K2) {
  const FundamentalFactors::Tangents tangents = E.ByStep();
  Eigen::Matrix<double, 9, kDofOfE> by;
  for (int k = 0; k < kDofOfE; ++k) {
    const Eigen::Map<const Eigen::Matrix3d> dE(tangents.col(k).data());
    by.col(k) = Stacked(K2.value.transpose() * dE * K1.value);
  }
  return by;
}

// Of the losses over the steps of E.
struct EssentialProblem {
  using State = FundamentalFactors;
  using Step = Eigen::Matrix<double, kDofOfE, 1>;

  Eigen::Matrix3d F(const State& E) const { return K2.value.transpose() * E.F() * K1.value; }
  NormalEquations<kDofOfE> Linearize(const State& at) const {
    return LinearizeFundamental(points, F(at), scale_px).Along<kDofOfE>(ByStep(at, K1, K2));
  }
  State Moved(const State& from, const Step& step) const {
    FundamentalFactors::Step all = FundamentalFactors::Step::Zero();
    all.head<kDofOfE>() = step;
    return from.Moved(all);
  }

  const PointPairs& points;
  double scale_px;
  InverseK K1, K2;
};

}  // namespace

EssentialTerm::EssentialTerm(const PointPairs& points, const FundamentalFit& fit,
                             const Eigen::Vector2d& principal_point_sigmas, const Intrinsics& at)
    : points_(&points),
      principal_point_sigmas_(principal_point_sigmas),
      scale_px_(LossScalePx(fit.sigma_px)) {
  variance_ = std::pow(fit.sigma_px / scale_px_, 2);
  cost_of_F_ = LinearizeFundamental(points, fit.F(), scale_px_).cost;
  const Eigen::Matrix3d K1 = InverseK(at.head<3>(), principal_point_sigmas[0]).value.inverse();
  const Eigen::Matrix3d K2 = InverseK(at.tail<3>(), principal_point_sigmas[1]).value.inverse();
  E_ = FundamentalFactors::Of(K2.transpose() * fit.F() * K1).value();
  const double cosine = E_.B(0, 0) + E_.B(1, 1), sine = E_.B(1, 0) - E_.B(0, 1);
  E_.B << cosine, -sine, sine, cosine;
  E_.B.normalize();
}

NormalEquations<EssentialTerm::kNumIntrinsics> EssentialTerm::Reduce(const Intrinsics& at) {
  EssentialProblem problem{*points_, scale_px_, InverseK(at.head<3>(), principal_point_sigmas_[0]),
                           InverseK(at.tail<3>(), principal_point_sigmas_[1])};
  Minimize(problem, {kMaxSteps, kMinGain}, &E_);
  constexpr int kNumAll = kDofOfE + kNumIntrinsics;
  Eigen::Matrix<double, 9, kNumAll> by;
  by.leftCols<kDofOfE>() = ByStep(E_, problem.K1, problem.K2);
  const Eigen::Matrix3d E = E_.F();
  for (int k = 0; k < 3; ++k) {
    by.col(kDofOfE + k) = Stacked(problem.K2.value.transpose() * E * problem.K1.by[k]);
    by.col(kDofOfE + 3 + k) = Stacked(problem.K2.by[k].transpose() * E * problem.K1.value);
  }
  const NormalEquations<kNumAll> all =
      LinearizeFundamental(*points_, problem.F(E_), scale_px_).Along<kNumAll>(by);
  const Eigen::Matrix<double, kDofOfE, kDofOfE> of_E =
      all.hessian.topLeftCorner<kDofOfE, kDofOfE>();
  NormalEquations<kNumIntrinsics> reduced;
  reduced.cost = std::max(0.0, all.cost - cost_of_F_) / variance_;
  reduced.gradient = all.gradient.tail<kNumIntrinsics>();
  reduced.hessian = all.hessian.bottomRightCorner<kNumIntrinsics, kNumIntrinsics>()
                        .selfadjointView<Eigen::Lower>();
  for (int k = 0; k < kNumIntrinsics; ++k) {
    Eigen::Matrix<double, kDofOfE, 1> change;  // of E with the intrinsics, negative
    const Eigen::Matrix<double, kDofOfE, 1> cross =
        all.hessian.row(kDofOfE + k).head<kDofOfE>().transpose();
    if (!SolvePositive<kDofOfE>(of_E, cross, &change)) {  // The matches leave E open.
      NormalEquations<kNumIntrinsics> open;
      open.cost = reduced.cost;
      return open;
    }
    reduced.gradient[k] -= change.dot(all.gradient.head<kDofOfE>());
    reduced.hessian.row(k) -=
        change.transpose() * all.hessian.bottomLeftCorner<kNumIntrinsics, kDofOfE>().transpose();
  }
  reduced.gradient /= variance_;
  reduced.hessian /= variance_;
  return reduced;
}

}  // namespace cairn::internal
