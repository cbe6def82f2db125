#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipeline/pairs/rounds.h"

namespace cairn {
namespace {

using ::testing::ElementsAre;

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
