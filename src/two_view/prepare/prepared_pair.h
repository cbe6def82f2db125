#pragma once

#include <array>
#include <span>
#include <vector>

#include "cairn/solvers/point_correspondence.h"
#include "cairn/two_view/pair_verifier.h"
#include "robust/point_pairs.h"

namespace cairn::internal {

// Scales of errors in thresholds. The threshold separates inliers; what is no mere noise of a model
// lies beyond kOutside. In the smooth loss e^2 / (s^2 + e^2) a match at kReach scales pulls less
// than 1 % of one at a scale's half.
inline constexpr double kOutside = 4.0, kReach = 16.0;

// Where a share of many matches is asked for, so many tell it: its standard error is below 1 / (2
// sqrt(256)), 3 %.
inline constexpr int kEnoughMatches = 256;

enum class MatchOrder {
  kGiven,        // best first if they came so (PairInput::are_best_first), otherwise random
  kByConsensus,  // matches with more votes of their neighbours first, among equals as kGiven
};

// The matches of a pair in normalized coordinates, in the order that the search works with.
struct PreparedPair {
  PairInput input;  // what it was made from
  // Undistorted positions. Matches whose pixels the camera model cannot express are left out.
  PointPairs points;
  std::vector<int32_t> match_index;  // of points[i] in input.matches

  // The threshold in force; by default the mean of those of both sizes. Errors are in pixels of an
  // image of that mean size: a pixel of the smaller image counts more, one of the larger less.
  double max_error_px = 1.0;
  // Probability that a random pair of points has an error below 1 px: band of an epipolar line over
  // the image area, the mean of both images.
  double chance_per_px = 1e-3;
  // Whether both images have affine frames: features of other programs may be positions alone.
  bool has_frames = false;

  // Votes that matches have of their neighbours (kByConsensus only): 4 and more, which wrong
  // matches hardly get by chance; fewer; none; not asked for. Class c ends before
  // points[vote_class_end[c]].
  static constexpr int kNumVoteClasses = 4;
  std::array<int, kNumVoteClasses> vote_class_end = {};
  int NumWellSupported() const { return vote_class_end[0]; }
  int NumSupported() const { return vote_class_end[1]; }  // any vote
  // How far the number of votes is above chance, in standard deviations.
  double consensus_sigmas = 0.0;

  // Indices of points, best match first; empty if it is not known which matches are better.
  std::vector<int32_t> best_first;

  int size() const { return points.size(); }
  // Do the matches bear each other out, by their frames (kByConsensus only)?
  bool IsSupported() const { return consensus_sigmas > 5.0; }
  // Share of the budgets: all of them where there are no frames to tell that it is no use.
  double BudgetShare(const TwoViewOptions& options) const {
    return IsSupported() || !has_frames ? 1.0 : options.unsupported_budget;
  }

  const FeatureMatch& Match(int i) const { return input.matches[match_index[i]]; }
  const Keypoint& Keypoint1(int i) const { return input.keypoints1[Match(i).point1]; }
  const Keypoint& Keypoint2(int i) const { return input.keypoints2[Match(i).point2]; }
  bool HasDepth() const { return !input.depth1.empty() && !input.depth2.empty(); }
  const DepthSample& Depth1(int i) const { return input.depth1[Match(i).point1]; }
  const DepthSample& Depth2(int i) const { return input.depth2[Match(i).point2]; }
  PointCorrespondence Points(int i) const { return {points.Point1(i), points.Point2(i)}; }
  FeatureMatches Matches(std::span<const int32_t> indices) const;

  // Some of its matches, by ascending indices, as a pair of its own; which are best is not told.
  PreparedPair Subset(std::span<const int32_t> indices) const;
};

// Orders and normalizes the matched keypoints. What `input` points to must outlive the result.
// `pair` is filled anew; its memory is used again.
void PreparePair(const PairInput& input, const TwoViewOptions& options, MatchOrder order,
                 PreparedPair* pair);

}  // namespace cairn::internal
