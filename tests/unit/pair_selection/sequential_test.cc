#include "cairn/base/error.h"
#include "cairn/pair_selection/pair_selection.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

Image Named(image_t id, const std::string& name) {
  return {.image_id = id, .name = name, .camera_id = 1};
}

TEST(Sequential, NamesAreOrderedByTheirNumbersWithinFolders) {
  const auto sequences =
      SequencesByName({Named(1, "b/img10.jpg"), Named(2, "b/img9.jpg"), Named(3, "a/2.jpg"),
                       Named(4, "b/img009.jpg"), Named(5, "a/12.jpg"), Named(6, "a/2x.jpg")});
  EXPECT_THAT(sequences, ElementsAre(ElementsAre(3, 6, 5), ElementsAre(4, 2, 1)));
}

TEST(Sequential, TimesOrderAndImagesWithoutAreLeftOut) {
  const std::vector<Image> images = {Named(1, "a.jpg"), Named(2, "b.jpg"), Named(3, "c.jpg"),
                                     Named(4, "d.jpg")};
  EXPECT_THAT(SequencesByTime(images, {{1, 30.5}, {2, 30.5}, {4, 30.25}}),
              ElementsAre(ElementsAre(4, 1, 2)));
}

TEST(Sequential, OverlapAndQuadraticOverlap) {
  const std::vector<std::vector<image_t>> sequences = {{7, 5, 6, 1, 2, 3}, {8, 9}};
  const auto pair = ImagePairToPairId;
  EXPECT_THAT(SequentialPairs(sequences, 1, false),
              ElementsAre(pair(1, 2), pair(1, 6), pair(2, 3), pair(5, 6), pair(5, 7), pair(8, 9)));
  // Two apart, too; four apart are beyond 2^1.
  EXPECT_THAT(SequentialPairs(sequences, 1, true),
              ElementsAre(pair(1, 2), pair(1, 3), pair(1, 5), pair(1, 6), pair(2, 3), pair(2, 6),
                          pair(5, 6), pair(5, 7), pair(6, 7), pair(8, 9)));
  EXPECT_EQ(SequentialPairs(sequences, 2, true).size(), 5u + 4u + 2u + 1u);
}

TEST(PairWays, NamesCombine) {
  EXPECT_THAT(ParsePairWays("retrieval,sequential"),
              ElementsAre(PairWay::kSequential, PairWay::kRetrieval));
  EXPECT_THAT(ParsePairWays("auto"), ElementsAre(PairWay::kAuto));
  const auto message = [](const char* text) {
    return ThrownMessage<ConfigError>([&] { ParsePairWays(text); });
  };
  EXPECT_THAT(message("vocabulary"), HasSubstr("retrieval"));
  EXPECT_THAT(message(""), HasSubstr("pairs"));
  EXPECT_THAT(message("spatial,"), HasSubstr("pairs"));
  EXPECT_THAT(message("spatial,exhaustive"), HasSubstr("'exhaustive' stands alone"));
  EXPECT_THAT(message("auto,spatial"), HasSubstr("'auto' stands alone"));
}

}  // namespace
}  // namespace cairn
