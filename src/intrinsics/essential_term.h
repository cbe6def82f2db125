#pragma once

#include <Eigen/Core>

#include "intrinsics/fundamental_fit.h"
#include "math/normal_equations.h"

namespace cairn::internal {

// What the matches of a pair say of the intrinsics: the squared errors, in their standard
// deviations, that the best essential matrix leaves beyond those that F leaves (the likelihood
// ratio: of two degrees of freedom, where the intrinsics are right). F = K2^-T E K1^-1 with K as in
// KruppaEquations.
class EssentialTerm {
 public:
  // Of either camera: log focal length, and principal point in its standard deviations.
  static constexpr int kNumIntrinsics = 6;
  using Intrinsics = Eigen::Matrix<double, kNumIntrinsics, 1>;

  // The points outlive this. Standard deviations of principal points in units of nominal focal
  // lengths. E is the nearest to the fit's F by these intrinsics.
  EssentialTerm(const PointPairs& points, const FundamentalFit& fit,
                const Eigen::Vector2d& principal_point_sigmas, const Intrinsics& at);

  // Finds the best E from the last one on, and gives its cost and the derivatives by the
  // intrinsics, of half the cost, with E free.
  NormalEquations<kNumIntrinsics> Reduce(const Intrinsics& at);
  // Squared errors count so many times less.
  void Doubt(double factor) { variance_ *= factor; }

 private:
  const PointPairs* points_;
  Eigen::Vector2d principal_point_sigmas_;
  double variance_;  // of an error, in the loss's scale
  double scale_px_;
  double cost_of_F_;
  FundamentalFactors E_;  // B is a rotation
};

}  // namespace cairn::internal
