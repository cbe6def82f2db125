#include <algorithm>
#include <set>

#include "cairn/base/rng.h"
#include "pipeline/pairs/plan.h"
#include "support/test.h"

namespace cairn {
namespace {

std::vector<image_pair_t> AllPairs(int num_images) {
  std::vector<image_pair_t> pairs;
  for (image_t i = 1; i <= static_cast<image_t>(num_images); ++i) {
    for (image_t j = i + 1; j <= static_cast<image_t>(num_images); ++j) {
      pairs.push_back(ImagePairToPairId(i, j));
    }
  }
  return pairs;
}

int64_t Bytes(const std::vector<image_t>& images, const std::map<image_t, int64_t>& image_bytes) {
  int64_t bytes = 0;
  for (const image_t id : images) bytes += image_bytes.at(id);
  return bytes;
}

TEST(PairPlan, HasEveryPairOnceWithinTheMemory) {
  Rng rng(1);
  std::map<image_t, int64_t> image_bytes;
  for (image_t id = 1; id <= 40; ++id) image_bytes[id] = 50 + rng.UniformInt(100);
  std::vector<image_pair_t> pairs = AllPairs(40);
  const int64_t max_bytes = 1000;
  std::vector<image_pair_t> planned;
  for (const PairTile& tile : PlanPairTiles(pairs, image_bytes, max_bytes)) {
    EXPECT_LE(Bytes(tile.images, image_bytes), max_bytes);
    for (const image_pair_t pair : tile.pairs) {
      const auto [id1, id2] = PairIdToImagePair(pair);
      EXPECT_TRUE(std::binary_search(tile.images.begin(), tile.images.end(), id1));
      EXPECT_TRUE(std::binary_search(tile.images.begin(), tile.images.end(), id2));
    }
    planned.insert(planned.end(), tile.pairs.begin(), tile.pairs.end());
  }
  std::sort(planned.begin(), planned.end());
  EXPECT_EQ(planned, pairs);
}

TEST(PairPlan, EnoughMemoryGivesOneTile) {
  std::map<image_t, int64_t> image_bytes;
  for (image_t id = 1; id <= 10; ++id) image_bytes[id] = 10;
  EXPECT_EQ(PlanPairTiles(AllPairs(10), image_bytes, 1000).size(), 1u);
}

// With g groups, serpentine order loads about half of the g * g groups that any other order of the
// tiles would load for rows, plus one a row.
TEST(PairPlan, NeighborsShareAGroup) {
  std::map<image_t, int64_t> image_bytes;
  for (image_t id = 1; id <= 60; ++id) image_bytes[id] = 10;
  const auto plan = PlanPairTiles(AllPairs(60), image_bytes, 200);  // 6 groups of 10 images.
  EXPECT_EQ(plan.size(), 21u);
  std::set<image_t> resident;
  int64_t num_loaded = 0;
  for (const PairTile& tile : plan) {
    for (const image_t id : tile.images) num_loaded += resident.count(id) == 0;
    resident = {tile.images.begin(), tile.images.end()};
  }
  EXPECT_LE(num_loaded, 10 * (1 + 20 + 4));  // A new group a tile, and at most one more at turns.
}

// A batch for another machine: in the order of their ids, a thousand pairs have all 400 images.
TEST(PairPlan, PairsThatFollowEachOtherHaveFewImages) {
  const auto plan = PlanPairTiles(AllPairs(400), {}, 1);
  ASSERT_EQ(plan.size(), 1u);
  for (size_t begin = 0; begin + 1024 <= plan[0].pairs.size(); begin += 1024) {
    std::set<image_t> images;
    for (size_t i = begin; i < begin + 1024; ++i) {
      const auto [id1, id2] = PairIdToImagePair(plan[0].pairs[i]);
      images.insert({id1, id2});
    }
    EXPECT_LE(images.size(), 4 * kBlockImages);
  }
}

TEST(PairPlan, ImagesLargerThanTheMemoryAreStillPaired) {
  const std::map<image_t, int64_t> image_bytes = {{1, 5000}, {2, 5000}, {3, 5000}};
  const auto plan = PlanPairTiles(AllPairs(3), image_bytes, 1);
  EXPECT_EQ(plan.size(), 3u);
  for (const PairTile& tile : plan) EXPECT_EQ(tile.images.size(), 2u);
}

TEST(PairPlan, NoPairsNoTiles) { EXPECT_TRUE(PlanPairTiles({}, {}, 100).empty()); }

image_pair_t Pair(image_t id1, image_t id2) { return ImagePairToPairId(id1, id2); }

TEST(LikelyPairs, HoldsTheMostMatchedPairsOfEveryImage) {
  const std::vector<std::pair<image_pair_t, int>> num_matches = {{Pair(1, 2), 90}, {Pair(1, 3), 20},
                                                                 {Pair(1, 4), 0},  {Pair(2, 3), 80},
                                                                 {Pair(2, 4), 5},  {Pair(3, 4), 3}};
  // Image 4 has none better than (2, 4); (1, 3) and (3, 4) are nobody's best.
  EXPECT_THAT(LikelyPairs(num_matches, 1), ElementsAre(Pair(1, 2), Pair(2, 3), Pair(2, 4)));
  EXPECT_EQ(LikelyPairs(num_matches, 3).size(), 6u);
}

TEST(LikelyPairs, OfEqualOnesTheSmallerIdComesFirst) {
  const std::vector<std::pair<image_pair_t, int>> num_matches = {
      {Pair(1, 2), 7}, {Pair(1, 3), 7}, {Pair(2, 3), 7}};
  EXPECT_THAT(LikelyPairs(num_matches, 1), ElementsAre(Pair(1, 2), Pair(1, 3)));
}

}  // namespace
}  // namespace cairn
