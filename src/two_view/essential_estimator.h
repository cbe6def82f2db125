#pragma once

#include "cairn/robust/pose_refinement.h"
#include "cairn/robust/ransac.h"
#include "cairn/solvers/five_point.h"
#include "two_view/prepared_pair.h"

namespace cairn::internal {

// The estimator of RANSAC over five points: essential matrices, MSAC over Sampson errors, local
// optimization by nonlinear refinement.
class FivePointEstimator {
 public:
  static constexpr int kSampleSize = FivePoint::kSampleSize;
  static constexpr int kMaxSolutions = FivePoint::kMaxSolutions;
  using Model = Eigen::Matrix3d;

  explicit FivePointEstimator(const PreparedPair& pair) : pair_(pair) {}

  int NumData() const { return pair_.size(); }
  int Solve(const uint32_t* sample, Model* models) const;
  double Score(const Model& E, double bound) const {
    return ScoreSampson(pair_.points, E, pair_.max_error_px, bound);
  }
  double Optimize(Model& E, int* num_inliers) const;

 private:
  const PreparedPair& pair_;
};

// Refines a pose with a shrinking scale down to the threshold of the pair; returns its MSAC
// support.
double RefineAndScore(const PreparedPair& pair, Rigid3d* pose);

}  // namespace cairn::internal
