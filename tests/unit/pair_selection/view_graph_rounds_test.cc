#include "cairn/pair_selection/pair_selection.h"
#include "support/test.h"

namespace cairn {
namespace {

const auto pair = ImagePairToPairId;

// Keypoints first .. first + num of one image are the same ones of the other.
FeatureMatches Same(point2D_t first, int num) {
  FeatureMatches matches;
  for (int k = 0; k < num; ++k) matches.push_back({first + k, first + k});
  return matches;
}

void AddVerified(PairEvidence& evidence, image_t id1, image_t id2,
                 const FeatureMatches& inliers = Same(0, 1)) {
  evidence.images.insert({id1, id2});
  evidence.matched.insert(pair(id1, id2));
  evidence.verified[pair(id1, id2)] = inliers;
}

TEST(PairsTwoEdgesApart, CountsPointsThatAThirdImageShares) {
  PairEvidence evidence;
  AddVerified(evidence, 1, 2, Same(0, 60));
  AddVerified(evidence, 2, 3, Same(20, 60));  // 40 points are in 1, 2 and 3
  AddVerified(evidence, 3, 4, Same(70, 60));  // 10 are in 2, 3 and 4
  AddVerified(evidence, 1, 5, Same(0, 50));   // 50 are in 2, 1 and 5,
  AddVerified(evidence, 3, 5, Same(30, 20));  // of which 2, 3 and 5 have 20: no new ones
  EXPECT_THAT(PairsTwoEdgesApart(evidence, 40, 9, 1), ElementsAre(pair(1, 3), pair(2, 5)));
  EXPECT_THAT(PairsTwoEdgesApart(evidence, 41, 9, 2), ElementsAre(pair(2, 5)));
  EXPECT_THAT(PairsTwoEdgesApart(evidence, 51, 9, 2), ElementsAre());
  EXPECT_THAT(PairsTwoEdgesApart(evidence, 10, 9, 2),
              ElementsAre(pair(1, 3), pair(2, 4), pair(2, 5)));
  evidence.matched.insert(pair(1, 3));  // in vain
  EXPECT_THAT(PairsTwoEdgesApart(evidence, 40, 9, 2), ElementsAre(pair(2, 5)));
}

// Without a limit, the pairs of an object that all photographs see are all there are.
TEST(PairsTwoEdgesApart, ImagesWithEnoughNeighborsAskForNoMore) {
  PairEvidence evidence;
  for (image_t i = 2; i <= 6; ++i) AddVerified(evidence, 1, i, Same(0, 10 * i));
  EXPECT_EQ(PairsTwoEdgesApart(evidence, 1, 9, 2).size(), 10);  // all others
  EXPECT_THAT(PairsTwoEdgesApart(evidence, 1, 1, 2), ElementsAre());
  // Each asks for one: that with the most shared points, of equal ones the first.
  EXPECT_THAT(PairsTwoEdgesApart(evidence, 1, 2, 2),
              ElementsAre(pair(2, 3), pair(3, 4), pair(4, 5), pair(5, 6)));
}

// A chain 1 - 2 - ... - 8; 1 and 8 look alike.
TEST(PairsClosingLoops, FarInTheGraphAndAlike) {
  PairEvidence evidence;
  for (image_t i = 1; i < 8; ++i) AddVerified(evidence, i, i + 1);
  evidence.matched.insert(pair(4, 7));
  const Queries queries = AskForLoops(evidence, 2);
  EXPECT_EQ(queries.size(), 8u);
  EXPECT_THAT(queries.at(1).left_out, ElementsAre(1, 2, 3));
  EXPECT_THAT(queries.at(4).left_out, ElementsAre(2, 3, 4, 5, 6, 7));

  Candidates first;
  for (image_t i = 1; i < 8; ++i) first[i] = {{i + 1, 30}};
  first[4].push_back({7, 10});
  const Candidates found = {{1, {{8, 21}, {7, 20}}}, {3, {}}, {5, {{1, 19}}}};
  // Pairs with 30 are verified, the one with 10 is not.
  EXPECT_THAT(PairsClosingLoops(evidence, first, found), ElementsAre());
  AddVerified(evidence, 2, 4);
  first[2].push_back({4, 20});
  EXPECT_THAT(PairsClosingLoops(evidence, first, found), ElementsAre(pair(1, 8)));
}

TEST(AskForWeakImages, FewPairsOrApart) {
  PairEvidence evidence;
  for (image_t i = 1; i <= 5; ++i) {
    for (image_t j = i + 1; j <= 5; ++j) AddVerified(evidence, i, j);
  }
  AddVerified(evidence, 5, 6);
  for (image_t i = 7; i <= 9; ++i) {
    for (image_t j = i + 1; j <= 10; ++j) AddVerified(evidence, i, j);
  }
  evidence.images.insert(11);
  evidence.matched.insert(pair(1, 11));
  const Queries queries = AskForWeakImages(evidence);
  EXPECT_EQ(queries.size(), 6u);                        // 1 to 5 have enough
  EXPECT_THAT(queries.at(6).left_out, ElementsAre(5));  // has one
  EXPECT_EQ(queries.at(6).part, nullptr);
  EXPECT_THAT(queries.at(8).left_out, ElementsAre(7, 9, 10));
  EXPECT_THAT(*queries.at(8).part, ElementsAre(7, 8, 9, 10));  // is apart
  EXPECT_THAT(queries.at(11).left_out, ElementsAre(1));        // has none
  EXPECT_THAT(*queries.at(11).part, ElementsAre(11));
}

// A list each would grow with the square of the part: 40 GB for 100,000 photographs.
TEST(AskForWeakImages, APartIsOneList) {
  PairEvidence evidence;
  for (image_t i = 1; i < 10; ++i) AddVerified(evidence, i, i + 1);
  for (image_t i = 11; i < 19; ++i) AddVerified(evidence, i, i + 1);
  const Queries queries = AskForWeakImages(evidence);
  EXPECT_EQ(queries.at(11).part->size(), 9u);
  EXPECT_EQ(queries.at(11).part, queries.at(19).part);
}

}  // namespace
}  // namespace cairn
