#pragma once

#include <optional>
#include <span>
#include <vector>

#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// What a pose alone does not show (COLMAP's `config`).
struct SpecialPair {
  TwoViewConfig config = TwoViewConfig::kCalibrated;
  // For planar and panoramic pairs: the homography of normalized points; of the latter, the
  // rotation that explains the matches without translation.
  Eigen::Matrix3d H = Eigen::Matrix3d::Identity();
};

// Looks at the inliers of a pose, given as indices into pair.points: do they follow a rotation
// alone (panoramic), to within the pair's noise (NoiseScalePx), one homography (planar), one shift
// within the frame of the images, or are they an overlay (watermark)?
SpecialPair ClassifyPair(const PreparedPair& pair, std::span<const int32_t> inliers,
                         double noise_px, const TwoViewOptions& options);

// How far a match moves in the picture, pixels.
Eigen::Vector2d ShiftOf(const PairInput& input, const FeatureMatch& match);

// The shift between the images of more than half of these matches, if they are at the same place of
// both, measured from a corner, the middle of a side, or the center. Marks that are printed over
// photographs are, wherever they are and however often they repeat; points of a scene only if the
// camera does not move.
std::optional<Eigen::Vector2d> OverlayShift(const PairInput& input,
                                            std::span<const FeatureMatch> matches,
                                            double max_error_px);

}  // namespace cairn::internal
