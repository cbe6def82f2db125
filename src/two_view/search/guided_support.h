#pragma once

#include <array>
#include <span>
#include <vector>

#include "robust/pose_refinement.h"
#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// `factor` times the median error of right matches, pixels, by the errors of all matches at a pose
// that was fitted to them: of those within one and a half thresholds, less as many as chance puts
// there, evenly. A fit to few matches is closer than their noise, which is allowed for (Rousseeuw
// and Leroy, 1987: 1 + 5 / (n - p)); that it is half of the threshold weighs as much as ten
// matches. At most one and a half thresholds.
double NoiseScalePx(const PreparedPair& pair, std::span<const float> errors_px, double factor);

// Of normal errors; and the scale of the smooth loss that fits a pair's noise, in sigmas.
inline constexpr double kSigmaOfMedian = 1.4826, kLossSigmas = 1.25;

// The error of a homography (HomographyErrors) that this noise of a coordinate stays below with
// 98 %: its square has the noise of both images in two coordinates, 4 noise_px^2 on average, and is
// nearly exponential.
inline double MaxTransferErrorPx(double noise_px) { return 4.0 * noise_px; }

// How well poses near a roughly right one explain the matches of a pair. Matches come in classes,
// by the votes of their neighbours; which share of a class is right is learned from the errors at
// the rough pose, and a match counts by the logarithm of its odds to be right, given that it fits:
// one that nobody bears out has to fit no less well, but is no reason to move the pose far from
// others (Tordoff and Murray, "Guided-MLESAC: faster image transform estimation by using matching
// priors", PAMI 2005). The loss is smooth, at the scale of the pair's noise.
class GuidedSupport {
 public:
  // errors_px: of all matches at the rough pose; those of reach_px and more are left out.
  void Learn(const PreparedPair& pair, std::span<const float> errors_px, double reach_px);

  double Score(const Eigen::Matrix3d& E) const;  // larger is better
  Rigid3d Refine(const Rigid3d& start) const;
  double scale_px() const { return kLossSigmas * sigma_px_; }  // of the smooth loss

 private:
  double sigma_px_ = 0.0;  // of the pair's noise
  std::array<PointPairs, PreparedPair::kNumVoteClasses> points_;
  std::vector<WeightedPoints> classes_;  // those that have points
};

}  // namespace cairn::internal
