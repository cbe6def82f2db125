#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "robust/fundamental_factors.h"

namespace cairn::internal {

// Matches that a fit of F needs: twice its seven dimensions, and one.
inline constexpr int kMinFundamentalMatches = 15;
inline constexpr double kMinSigmaPx = 0.05;  // of matches: no detector is more exact

struct FundamentalFit : FundamentalFactors {
  Eigen::Matrix<double, kDof, kDof> covariance;  // of the steps in its seven directions
  double sigma_px = 0;                           // of the matches, by their median error
};

// RefineFundamentalMatrix from `start` at a scale that follows the errors; rays x1, x2 (third
// component 1; divided by nominal focal lengths, in pixels, which turn errors into pixels). Absent
// for too few matches, or where they do not determine F at all.
std::optional<FundamentalFit> FitFundamental(std::span<const Eigen::Vector2d> x1,
                                             std::span<const Eigen::Vector2d> x2, double focal1_px,
                                             double focal2_px, const Eigen::Matrix3d& start);

}  // namespace cairn::internal
