#include "two_view/prepare/prepared_pair.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "cairn/base/check.h"
#include "cairn/base/rng.h"
#include "two_view/prepare/local_consensus.h"

namespace cairn::internal {
namespace {

// A line of the length of the diagonal, one pixel wide on either side.
double BandPerPx(const Camera& camera) {
  return 2.0 * camera.DiagonalPx() / (static_cast<double>(camera.width) * camera.height);
}

// How much a pixel of the image counts among the errors of the pair: by the threshold of its size.
double UnitsPerPx(const Camera& camera, const TwoViewOptions& options, const PreparedPair& pair) {
  return options.max_error_px > 0.0 ? 1.0 : pair.max_error_px / DefaultMaxErrorPx(camera, camera);
}

// Votes are counted among so many matches: enough to find right ones where there are more.
constexpr int kMaxVoters = 512;

// The matches' order, first those with votes; fills what is known of these.
void OrderByConsensus(std::vector<int32_t>* order, PreparedPair* pair) {
  const size_t num_voters = std::min<size_t>(order->size(), kMaxVoters);
  const LocalConsensus consensus =
      CountVotes(pair->input, std::span<const int32_t>(*order).first(num_voters));
  // More than that only tell where matches are dense.
  constexpr int kManyVotes = 4;
  auto class_of = [](int votes) { return votes >= kManyVotes ? 0 : votes > 0 ? 1 : 2; };
  std::vector<int32_t> sorted;
  sorted.reserve(num_voters);
  for (int c = 0; c < PreparedPair::kNumVoteClasses - 1; ++c) {
    for (size_t k = 0; k < num_voters; ++k) {
      if (class_of(consensus.votes[k]) == c) sorted.push_back((*order)[k]);
    }
    pair->vote_class_end[c] = static_cast<int>(sorted.size());
  }
  std::copy(sorted.begin(), sorted.end(), order->begin());
  const double by_chance = consensus.num_votes_by_chance;
  pair->consensus_sigmas = (consensus.num_votes - by_chance) / std::sqrt(by_chance + 1.0);
}

// The rows of a match lie anywhere in their images, and from here on are read in random order:
// waiting for them one by one took a fourteenth of the verification.
void PrefetchMatch(const PairInput& input, const FeatureMatch& match) {
  hwy::Prefetch(input.keypoints1.data() + match.point1);
  hwy::Prefetch(input.keypoints2.data() + match.point2);
  if (!input.depth1.empty()) hwy::Prefetch(input.depth1.data() + match.point1);
  if (!input.depth2.empty()) hwy::Prefetch(input.depth2.data() + match.point2);
}

// Whether any of the matched keypoints is more than a position: those have the identity for a
// shape.
bool HasFrames(std::span<const Keypoint> keypoints, std::span<const FeatureMatch> matches,
               point2D_t FeatureMatch::*point) {
  return std::any_of(matches.begin(), matches.end(), [&](const FeatureMatch& match) {
    const Keypoint& keypoint = keypoints[match.*point];
    return !(keypoint == Keypoint{.x = keypoint.x, .y = keypoint.y});
  });
}

// Undistorts the matches in their order and leaves out those that a camera cannot express.
void Undistort(std::span<const int32_t> order, double units_per_px1, double units_per_px2,
               PreparedPair* pair) {
  const PairInput& input = pair->input;
  const std::array<int, PreparedPair::kNumVoteClasses> class_end = pair->vote_class_end;
  const int num_matches = static_cast<int>(order.size());
  pair->points.Reset(num_matches, units_per_px1 * input.camera1->MeanFocal(),
                     units_per_px2 * input.camera2->MeanFocal(),
                     !input.camera1->IsPlanar() || !input.camera2->IsPlanar());
  pair->match_index.clear();
  int c = 0;
  for (int k = 0; k <= num_matches; ++k) {
    const int num_kept = static_cast<int>(pair->match_index.size());
    while (c < PreparedPair::kNumVoteClasses && class_end[c] == k) {
      pair->vote_class_end[c++] = num_kept;
    }
    if (k == num_matches) break;
    const FeatureMatch& match = input.matches[order[k]];
    const Eigen::Vector2d pixel1 = input.keypoints1[match.point1].Position();
    const Eigen::Vector2d pixel2 = input.keypoints2[match.point2].Position();
    if (!pair->points.SetPixels(num_kept, *input.camera1, pixel1, *input.camera2, pixel2)) {
      continue;
    }
    pair->match_index.push_back(order[k]);
  }
  pair->points.Truncate(static_cast<int>(pair->match_index.size()));
}

}  // namespace

FeatureMatches PreparedPair::Matches(std::span<const int32_t> indices) const {
  FeatureMatches matches;
  matches.reserve(indices.size());
  for (const int32_t i : indices) matches.push_back(Match(i));
  return matches;
}

PreparedPair PreparedPair::Subset(std::span<const int32_t> indices) const {
  PreparedPair subset;
  subset.input = input;
  subset.points.SetSubset(points, indices.data(), static_cast<int>(indices.size()));
  for (const int32_t i : indices) subset.match_index.push_back(match_index[i]);
  subset.max_error_px = max_error_px;
  subset.chance_per_px = chance_per_px;
  subset.has_frames = has_frames;
  for (int c = 0; c < kNumVoteClasses; ++c) {
    const auto end = std::lower_bound(indices.begin(), indices.end(), vote_class_end[c]);
    subset.vote_class_end[c] = static_cast<int>(end - indices.begin());
  }
  subset.consensus_sigmas = consensus_sigmas;
  return subset;
}

void PreparePair(const PairInput& input, const TwoViewOptions& options, MatchOrder match_order,
                 PreparedPair* pair) {
  CAIRN_CHECK(input.camera1 != nullptr && input.camera2 != nullptr);
  CAIRN_CHECK(input.depth1.empty() || input.depth1.size() == input.keypoints1.size());
  CAIRN_CHECK(input.depth2.empty() || input.depth2.size() == input.keypoints2.size());
  const Camera& camera1 = *input.camera1;
  const Camera& camera2 = *input.camera2;
  pair->input = input;
  pair->max_error_px =
      options.max_error_px > 0.0 ? options.max_error_px : DefaultMaxErrorPx(camera1, camera2);
  const double units_per_px1 = UnitsPerPx(camera1, options, *pair);
  const double units_per_px2 = UnitsPerPx(camera2, options, *pair);
  pair->chance_per_px =
      0.5 * (BandPerPx(camera1) / units_per_px1 + BandPerPx(camera2) / units_per_px2);
  for (const FeatureMatch& match : input.matches) {
    CAIRN_CHECK_LT(match.point1, input.keypoints1.size());
    CAIRN_CHECK_LT(match.point2, input.keypoints2.size());
    PrefetchMatch(input, match);
  }
  pair->has_frames = HasFrames(input.keypoints1, input.matches, &FeatureMatch::point1) &&
                     HasFrames(input.keypoints2, input.matches, &FeatureMatch::point2);
  std::vector<int32_t> order(input.matches.size());
  std::iota(order.begin(), order.end(), 0);
  if (!pair->input.are_best_first) Rng(input.seed, "order", input.pair_id).Shuffle(order);
  pair->vote_class_end.fill(0);
  pair->vote_class_end.back() = static_cast<int>(order.size());
  pair->consensus_sigmas = 0.0;
  if (match_order == MatchOrder::kByConsensus && pair->has_frames) OrderByConsensus(&order, pair);
  Undistort(order, units_per_px1, units_per_px2, pair);
  pair->best_first.clear();
  if (!pair->input.are_best_first) return;
  pair->best_first.resize(pair->match_index.size());
  std::iota(pair->best_first.begin(), pair->best_first.end(), 0);
  std::ranges::sort(pair->best_first, {}, [pair](int32_t i) { return pair->match_index[i]; });
}

}  // namespace cairn::internal
