#include "database/match_origins.h"

#include "database/stage_names.h"
#include "support/test.h"
#include "unit/database/database_fixture.h"

namespace cairn {
namespace {

TEST(MatchOrigins, OursHaveTwoRecordsAndAtMostOneGivenImage) {
  Database database(":memory:");
  WriteImages(database, 6);
  for (const image_t image : {1, 2}) database.WriteJob(kStageMatching, {image, 0, ""});
  for (const image_t image : {3, 4}) database.WriteJob(kStageMatching, {image, 0, kGivenNote});
  database.WriteMatches(ImagePairToPairId(1, 2), {});
  database.WriteMatches(ImagePairToPairId(2, 5), {});
  const MatchOrigins origins(database);
  EXPECT_THAT(origins.unrecorded(), ElementsAre(2, 5));
  const std::vector<bool> is_given = {false, false, true, true, true, false};
  for (image_t id = 1; id <= 6; ++id) EXPECT_EQ(origins.IsGiven(id), is_given[id - 1]) << id;
  EXPECT_TRUE(origins.AreOurs(ImagePairToPairId(1, 2)));
  EXPECT_TRUE(origins.AreOurs(ImagePairToPairId(2, 3)));
  EXPECT_FALSE(origins.AreOurs(ImagePairToPairId(3, 4)));
  EXPECT_FALSE(origins.AreOurs(ImagePairToPairId(1, 5)));
  EXPECT_TRUE(origins.AreGiven(ImagePairToPairId(3, 4)));
  EXPECT_TRUE(origins.AreGiven(ImagePairToPairId(3, 5)));
  EXPECT_FALSE(origins.AreGiven(ImagePairToPairId(2, 3)));
  EXPECT_FALSE(origins.AreGiven(ImagePairToPairId(3, 6)));
}

}  // namespace
}  // namespace cairn
