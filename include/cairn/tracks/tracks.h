#pragma once

#include <map>
#include <span>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/base/run_context.h"
#include "cairn/scene/reconstruction.h"

namespace cairn {

struct TrackOptions {
  // Shortest track that is kept, in images.
  int min_length = 2;
  // Tracks are picked, long ones first, until every image has this many (0: all are kept).
  int max_per_image = 0;

  void VisitFields(OptionVisitor& v);
};

// Inlier matches of one pair of images, which belong to someone else.
struct PairMatches {
  image_t image_id1 = kInvalidImageId;
  image_t image_id2 = kInvalidImageId;
  std::span<const FeatureMatch> matches;
};

struct TrackReport {
  int64_t num_matches = 0;      // given
  int64_t num_conflicting = 0;  // matches left out
  int64_t num_tracks = 0;
  int64_t num_observations = 0;
  std::vector<Track> tracks;  // sorted by their first element, then the second, ...
};

// Joins matches to tracks by union-find, those of the best-supported pairs first. Every track has
// at most one keypoint of an image: a match that would join two of them is left out. The result
// does not depend on the order of `pairs`, on the order of the matches within them or on
// run.num_threads. Cost: O(m log m) in the number of matches.
TrackReport BuildTracks(std::span<const PairMatches> pairs, const TrackOptions& options,
                        const RunContext& run = {});

// Some of the tracks, in their order, that give every image enough of them: long tracks come first,
// a track is taken while one of its images has fewer than `min_per_image` taken tracks.
std::vector<Track> SelectTracks(std::span<const Track> tracks, int min_per_image);

// Detectors give one position several keypoints (one an orientation). For every keypoint, the first
// keypoint of the image at the same position.
std::vector<point2D_t> FirstKeypointsAtPosition(std::span<const Keypoint> keypoints);

}  // namespace cairn
