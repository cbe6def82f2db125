#pragma once

#include <vector>

#include "cairn/robust/point_pairs.h"
#include "cairn/solvers/one_affine_depth.h"
#include "cairn/two_view/pair_verifier.h"

namespace cairn::internal {

// The matches of a pair in normalized coordinates, in the order that verifiers work with. Owned by
// a verifier and refilled for every pair.
struct PreparedPair {
  // Undistorted positions. Matches whose pixels the camera model cannot express are left out.
  PointPairs points;
  std::vector<int32_t> match_index;  // of points[i] in PairInput::matches

  double max_error_px = 1.0;  // the threshold in force
  // Probability that a random pair of points has an error below 1 px: band of an epipolar line over
  // the image area, the mean of both images.
  double chance_per_px = 1e-3;

  int size() const { return points.size(); }
};

// Normalizes the matched keypoints.
void PreparePair(const PairInput& input, const TwoViewOptions& options, PreparedPair* pair);

}  // namespace cairn::internal
