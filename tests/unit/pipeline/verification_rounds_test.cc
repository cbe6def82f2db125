#include "pipeline/verification_rounds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/temp_folder.h"

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

TEST(LearnDepthVotes, AddsUpLikelyPairsAndKeepsWhatIsKnown) {
  const testing::TempFolder folder;
  Database database(folder / "a.db");
  database.WriteCamera(Camera::FromFocal(1, CameraModel::kPinhole, 100, 640, 480));
  for (image_t id = 1; id <= 4; ++id) database.WriteImage({id, "image" + std::to_string(id), 1});
  database.WritePairDepthVotes(Pair(1, 2), {100, 10});
  database.WritePairDepthVotes(Pair(2, 3), {50, 0});
  database.WritePairDepthVotes(Pair(3, 4), {70, 70});
  database.WriteImageDepthVotes(1, {8, 8});
  LearnDepthVotes(database, {Pair(1, 2), Pair(2, 3)});
  const auto votes = database.ReadImageDepthVotes();
  ASSERT_EQ(votes.size(), 3u);
  EXPECT_EQ(votes.at(1).num_hypotheses, 8);
  EXPECT_EQ(votes.at(2).num_hypotheses, 150);
  EXPECT_EQ(votes.at(2).num_right, 10);
  EXPECT_EQ(votes.at(3).num_hypotheses, 50);
  EXPECT_EQ(votes.at(3).num_right, 0);
}

}  // namespace
}  // namespace cairn
