#include "cairn/tracks/tracks.h"

#include <algorithm>
#include <map>
#include <memory>
#include <set>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "support/test.h"

namespace cairn {
namespace {

Track MakeTrack(std::initializer_list<std::pair<image_t, point2D_t>> elements) {
  Track track;
  for (const auto& [image_id, point] : elements) track.push_back({image_id, point});
  return track;
}

struct OwnedPair {
  image_t image_id1, image_id2;
  FeatureMatches matches;
};

TrackReport Build(const std::vector<OwnedPair>& pairs, const TrackOptions& options) {
  std::vector<PairMatches> views;
  for (const OwnedPair& pair : pairs) {
    views.push_back({pair.image_id1, pair.image_id2, pair.matches});
  }
  return BuildTracks(views, options);
}

TEST(BuildTracks, JoinsMatchesOfSeveralPairs) {
  const std::vector<OwnedPair> pairs = {
      {1, 2, {{0, 5}, {1, 6}}}, {2, 3, {{5, 7}}}, {1, 3, {{0, 7}, {9, 8}}}};
  const TrackReport report = Build(pairs, {});
  EXPECT_THAT(report.tracks, ElementsAre(MakeTrack({{1, 0}, {2, 5}, {3, 7}}),
                                         MakeTrack({{1, 1}, {2, 6}}), MakeTrack({{1, 9}, {3, 8}})));
  EXPECT_EQ(report.num_matches, 5);
  EXPECT_EQ(report.num_tracks, 3);
  EXPECT_EQ(report.num_observations, 7);
  EXPECT_EQ(report.num_conflicting, 0);
}

// What the documentation says, one match after the other.
std::set<Track> TracksByDefinition(std::vector<OwnedPair> pairs) {
  std::stable_sort(pairs.begin(), pairs.end(), [](const OwnedPair& a, const OwnedPair& b) {
    return std::make_tuple(-std::ssize(a.matches), a.image_id1, a.image_id2) <
           std::make_tuple(-std::ssize(b.matches), b.image_id1, b.image_id2);
  });
  std::map<TrackElement, std::shared_ptr<Track>> track_of;
  const auto find = [&](const TrackElement& element) {
    std::shared_ptr<Track>& track = track_of[element];
    if (!track) track = std::make_shared<Track>(Track{element});
    return track;
  };
  for (OwnedPair& pair : pairs) {
    std::ranges::sort(pair.matches, {},
                      [](const FeatureMatch& m) { return std::make_pair(m.point1, m.point2); });
    for (const FeatureMatch& match : pair.matches) {
      const std::shared_ptr<Track> track1 = find({pair.image_id1, match.point1});
      const std::shared_ptr<Track> track2 = find({pair.image_id2, match.point2});
      std::set<image_t> images;
      for (const TrackElement& element : *track1) images.insert(element.image_id);
      for (const TrackElement& element : *track2) images.insert(element.image_id);
      if (track1 == track2 || images.size() < track1->size() + track2->size()) continue;
      track1->insert(track1->end(), track2->begin(), track2->end());
      for (const TrackElement& element : *track2) track_of[element] = track1;
    }
  }
  std::set<Track> tracks;
  for (const auto& [element, track] : track_of) {
    std::sort(track->begin(), track->end());
    if (track->size() >= 2) tracks.insert(*track);
  }
  return tracks;
}

// All pairs of images have random matches, as many as num_matches() gives; a share of them is
// wrong.
template <class NumMatches>
std::vector<OwnedPair> RandomPairs(image_t num_images, uint32_t num_points, double wrong_share,
                                   Rng& rng, const NumMatches& num_matches) {
  std::vector<OwnedPair> pairs;
  for (image_t a = 1; a <= num_images; ++a) {
    for (image_t b = a + 1; b <= num_images; ++b) {
      OwnedPair pair{a, b, {}};
      for (uint32_t k = num_matches(); k > 0; --k) {
        const point2D_t point = rng.UniformInt(num_points);
        const bool is_wrong = rng.Uniform() < wrong_share;
        pair.matches.push_back({point, is_wrong ? rng.UniformInt(num_points) : point});
      }
      pairs.push_back(std::move(pair));
    }
  }
  return pairs;
}

// More matches than are looked at in parallel at a time; a tenth of them wrong.
TEST(BuildTracks, OfManyMatchesAreThoseOfOneAfterTheOther) {
  Rng rng(5, "tracks");
  const std::vector<OwnedPair> pairs =
      RandomPairs(40, 1000, 0.1, rng, [&] { return 200 + rng.UniformInt(400); });
  std::vector<PairMatches> views;
  for (const OwnedPair& pair : pairs) {
    views.push_back({pair.image_id1, pair.image_id2, pair.matches});
  }
  const TrackReport report = BuildTracks(views, {}, {.num_threads = 8});
  EXPECT_GT(report.num_matches, 300'000);
  EXPECT_GT(report.num_conflicting, 30'000);
  const std::set<Track> expected = TracksByDefinition(pairs);
  ASSERT_EQ(report.tracks.size(), expected.size());
  EXPECT_TRUE(std::ranges::equal(report.tracks, expected));
  const TrackReport by_one = BuildTracks(views, {}, {.num_threads = 1});
  EXPECT_EQ(by_one.tracks, report.tracks);
  EXPECT_EQ(by_one.num_conflicting, report.num_conflicting);
}

// Many photographs of one thing; a hundredth of the matches is wrong.
TEST(BuildTracks, ThatAreLongAreThoseOfOneMatchAfterTheOther) {
  constexpr image_t kNumImages = 150;
  Rng rng(5, "long tracks");
  const std::vector<OwnedPair> pairs =
      RandomPairs(kNumImages, 40, 0.01, rng, [&] { return rng.UniformInt(4); });
  const TrackReport report = Build(pairs, {});
  EXPECT_GT(report.num_conflicting, 1000);
  const std::set<Track> expected = TracksByDefinition(pairs);
  EXPECT_TRUE(std::ranges::equal(report.tracks, expected));
  const auto length = [](const Track& track) { return track.size(); };
  EXPECT_GT(std::ranges::max(expected, {}, length).size(), kNumImages / 2);
}

TEST(BuildTracks, AcceptsImagesInEitherOrder) {
  const std::vector<OwnedPair> forward = {{1, 2, {{0, 5}}}};
  const std::vector<OwnedPair> backward = {{2, 1, {{5, 0}}}};
  EXPECT_EQ(Build(forward, {}).tracks, Build(backward, {}).tracks);
}

TEST(BuildTracks, EmptyInputGivesNoTracks) {
  EXPECT_THAT(Build({}, {}).tracks, IsEmpty());
  const std::vector<OwnedPair> pairs = {{1, 2, {}}};
  EXPECT_THAT(Build(pairs, {}).tracks, IsEmpty());
}

TEST(BuildTracks, RejectsAnImageMatchedWithItself) {
  const std::vector<OwnedPair> pairs = {{1, 1, {{0, 1}}}};
  EXPECT_THROW(Build(pairs, {}), BugError);
}

// Keypoints 1 and 2 of image 1 are joined over image 3 by the pair with the least support.
std::vector<OwnedPair> ConflictingPairs() {
  return {{1, 2, {{1, 1}, {2, 2}, {3, 3}}}, {2, 3, {{1, 1}, {3, 3}}}, {1, 3, {{2, 1}}}};
}

TEST(BuildTracks, LeavesOutTheConflictingMatchOfTheWeakestPair) {
  const TrackReport report = Build(ConflictingPairs(), {});
  EXPECT_THAT(report.tracks,
              ElementsAre(MakeTrack({{1, 1}, {2, 1}, {3, 1}}), MakeTrack({{1, 2}, {2, 2}}),
                          MakeTrack({{1, 3}, {2, 3}, {3, 3}})));
  EXPECT_EQ(report.num_conflicting, 1);
}

TEST(BuildTracks, MinLengthLeavesOutShortTracks) {
  TrackOptions options;
  options.min_length = 3;
  const std::vector<OwnedPair> pairs = {{1, 2, {{0, 5}, {1, 6}}}, {2, 3, {{5, 7}}}};
  const TrackReport report = Build(pairs, options);
  EXPECT_THAT(report.tracks, ElementsAre(MakeTrack({{1, 0}, {2, 5}, {3, 7}})));
}

TEST(BuildTracks, RefusesMeaninglessOptions) {
  TrackOptions options;
  options.min_length = 1;
  EXPECT_THROW(Build({}, options), ConfigError);
}

TEST(BuildTracks, MaxPerImagePrefersLongTracks) {
  TrackOptions options;
  options.max_per_image = 1;
  const std::vector<OwnedPair> pairs = {{1, 2, {{0, 0}, {1, 1}, {2, 2}}}, {2, 3, {{1, 1}}}};
  const TrackReport report = Build(pairs, options);
  EXPECT_THAT(report.tracks, ElementsAre(MakeTrack({{1, 1}, {2, 1}, {3, 1}})));
}

std::vector<OwnedPair> RandomPairs(Rng& rng) {
  std::vector<OwnedPair> pairs;
  for (image_t i = 1; i <= 8; ++i) {
    for (image_t j = i + 1; j <= 8; ++j) {
      OwnedPair pair{i, j, {}};
      const uint32_t n = rng.UniformInt(40);
      for (uint32_t k = 0; k < n; ++k) {
        // Mostly the same keypoint, so that tracks are long; now and then a wrong one.
        const point2D_t point = rng.UniformInt(100);
        pair.matches.push_back({point, rng.Uniform() < 0.9 ? point : rng.UniformInt(100)});
      }
      pairs.push_back(pair);
    }
  }
  return pairs;
}

TEST(BuildTracks, TracksAreDisjointSortedAndWithoutConflicts) {
  Rng rng(1);
  for (int trial = 0; trial < 50; ++trial) {
    const TrackReport report = Build(RandomPairs(rng), {});
    std::vector<TrackElement> all;
    for (const Track& track : report.tracks) {
      for (size_t i = 1; i < track.size(); ++i) {
        ASSERT_LT(track[i - 1].image_id, track[i].image_id);
      }
      all.insert(all.end(), track.begin(), track.end());
    }
    std::sort(all.begin(), all.end());
    EXPECT_EQ(std::adjacent_find(all.begin(), all.end()), all.end());
    EXPECT_TRUE(std::is_sorted(report.tracks.begin(), report.tracks.end()));
  }
}

TEST(BuildTracks, DoesNotDependOnTheOrderOfTheInput) {
  Rng rng(2);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<OwnedPair> pairs = RandomPairs(rng);
    const std::vector<Track> expected = Build(pairs, {}).tracks;
    rng.Shuffle(pairs);
    for (OwnedPair& pair : pairs) rng.Shuffle(pair.matches);
    EXPECT_EQ(Build(pairs, {}).tracks, expected);
  }
}

TEST(SelectTracks, CoversEveryImage) {
  Rng rng(3);
  const std::vector<Track> tracks = Build(RandomPairs(rng), {}).tracks;
  const auto count = [](const std::vector<Track>& all, image_t id) {
    return std::count_if(all.begin(), all.end(), [&](const Track& track) {
      return std::any_of(track.begin(), track.end(),
                         [&](const TrackElement& e) { return e.image_id == id; });
    });
  };
  const std::vector<Track> selected = SelectTracks(tracks, 20);
  EXPECT_LT(selected.size(), tracks.size());
  EXPECT_TRUE(std::is_sorted(selected.begin(), selected.end()));
  for (image_t id = 1; id <= 8; ++id) {
    EXPECT_GE(count(selected, id), std::min<int64_t>(20, count(tracks, id)));
  }
}

TEST(FirstKeypointsAtPosition, MapsOrientationsOfOnePositionToTheFirst) {
  const std::vector<Keypoint> keypoints = {
      {.x = 3, .y = 4}, {.x = 1, .y = 2}, {.x = 3, .y = 4, .a11 = 2}, {.x = 3, .y = 5}};
  EXPECT_THAT(FirstKeypointsAtPosition(keypoints), ElementsAre(0, 1, 0, 3));
  EXPECT_THAT(FirstKeypointsAtPosition({}), IsEmpty());
}

}  // namespace
}  // namespace cairn
