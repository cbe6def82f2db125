#include "database/own_matches.h"

#include <gtest/gtest.h>

#include "database/stage_names.h"

namespace cairn {
namespace {

TEST(OwnMatches, AreThoseOfOurStageWithAtMostOneGivenImage) {
  Database database(":memory:", Database::Mode::kCreateOrOpen);
  for (const image_t image : {1, 2}) database.WriteJob(kStageMatching, {image, 0, ""});
  for (const image_t image : {3, 4}) database.WriteJob(kStageMatching, {image, 0, kGivenNote});
  const OwnMatches own(database);
  EXPECT_TRUE(own.Contains(ImagePairToPairId(1, 2)));
  EXPECT_TRUE(own.Contains(ImagePairToPairId(2, 3)));
  EXPECT_FALSE(own.Contains(ImagePairToPairId(3, 4)));
  EXPECT_FALSE(own.Contains(ImagePairToPairId(1, 5)));
}

}  // namespace
}  // namespace cairn
