#pragma once

#include <Eigen/Core>
#include <optional>

#include "robust/fundamental_factors.h"
#include "robust/point_pairs.h"

namespace cairn::internal {

// Matches that a fit of F needs: twice its seven dimensions, and one.
inline constexpr int kMinFundamentalMatches = 15;
inline constexpr double kMinSigmaPx = 0.05;  // of matches: no detector is more exact

struct FundamentalFit : FundamentalFactors {
  Eigen::Matrix<double, kDof, kDof> covariance;           // of the steps in its seven directions
  Eigen::Matrix<double, kDof, kDof> covariance_of_noise;  // the part of it that noise explains
  double sigma_px = 0;                                    // of the matches, by their median error
};

// Of the robust loss that belongs to this standard deviation.
double LossScalePx(double sigma_px);

// RefineFundamentalMatrix from `start` at a scale that follows the errors. Absent for too few
// matches, or where they do not determine F at all.
std::optional<FundamentalFit> FitFundamental(const PointPairs& points,
                                             const Eigen::Matrix3d& start);

}  // namespace cairn::internal
