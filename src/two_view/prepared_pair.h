#pragma once

#include <vector>

#include "cairn/robust/point_pairs.h"
#include "cairn/two_view/pair_verifier.h"
#include "two_view/local_consensus.h"

namespace cairn::internal {

enum class MatchOrder {
  kRandom,
  kByConsensus,  // matches with more votes of their neighbours first, random among equals
};

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

  // The first num_supported matches have votes of their neighbours (kByConsensus only), the first
  // num_well_supported four or more, which wrong matches hardly get by chance; and how far the
  // number of votes is above chance, in standard deviations.
  int num_supported = 0;
  int num_well_supported = 0;
  double consensus_sigmas = 0.0;

  int size() const { return points.size(); }
  // Do the matches bear each other out, by their frames (kByConsensus only)?
  bool IsSupported() const { return consensus_sigmas > 5.0; }

  // Scratch.
  LocalConsensus consensus;
  std::vector<int32_t> order;
};

// Orders and normalizes the matched keypoints.
void PreparePair(const PairInput& input, const TwoViewOptions& options, MatchOrder order,
                 PreparedPair* pair);

}  // namespace cairn::internal
