#pragma once

#include <array>
#include <vector>

#include "cairn/robust/point_pairs.h"
#include "cairn/two_view/pair_verifier.h"
#include "two_view/prepare/local_consensus.h"

namespace cairn::internal {

enum class MatchOrder {
  kGiven,        // best first if they came so (PairInput::matches), otherwise random
  kByConsensus,  // matches with more votes of their neighbours first, among equals as kGiven
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

  // Votes that matches have of their neighbours (kByConsensus only): 4 and more, which wrong
  // matches hardly get by chance; 2 or 3; 1; none; not asked for. Class c ends before
  // points[vote_class_end[c]].
  static constexpr int kNumVoteClasses = 5;
  std::array<int, kNumVoteClasses> vote_class_end = {};
  int NumWellSupported() const { return vote_class_end[0]; }
  int NumSupported() const { return vote_class_end[2]; }  // any vote
  // How far the number of votes is above chance, in standard deviations.
  double consensus_sigmas = 0.0;

  // Indices of points, best match first; empty if it is not known which matches are better.
  std::vector<int32_t> best_first;

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
