#include "cairn/base/check.h"
#include "cairn/base/types.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

std::string BugMessage(void (*run)()) {
  return ThrownMessage<BugError>([&] { run(); });
}

TEST(Check, MessageHasFileLineTextAndValues) {
  const std::string message = BugMessage([] {
    const int a = 3;
    CAIRN_CHECK_LT(a, 2);
  });
  EXPECT_NE(message.find("base_test.cc:"), std::string::npos) << message;
  EXPECT_NE(message.find("a < 2 (3 vs. 2)"), std::string::npos) << message;
  EXPECT_NE(BugMessage([] { CAIRN_CHECK(1 + 1 == 3); }).find("1 + 1 == 3"), std::string::npos);
}

TEST(Check, AllComparisons) {
  EXPECT_EQ(BugMessage([] {
              CAIRN_CHECK(true);
              CAIRN_CHECK_EQ(1, 1);
              CAIRN_CHECK_NE(1, 2);
              CAIRN_CHECK_LT(1, 2);
              CAIRN_CHECK_LE(2, 2);
              CAIRN_CHECK_GT(2, 1);
              CAIRN_CHECK_GE(2, 2);
            }),
            "no error");
  EXPECT_NE(BugMessage([] { CAIRN_CHECK_EQ(1, 2); }), "no error");
  EXPECT_NE(BugMessage([] { CAIRN_CHECK_NE(1, 1); }), "no error");
  EXPECT_NE(BugMessage([] { CAIRN_CHECK_LE(2, 1); }), "no error");
  EXPECT_NE(BugMessage([] { CAIRN_CHECK_GT(1, 1); }), "no error");
  EXPECT_NE(BugMessage([] { CAIRN_CHECK_GE(1, 2); }), "no error");
}

TEST(Check, ValuesAreEvaluatedOnce) {
  int count = 0;
  CAIRN_CHECK_GE(++count, 1);
  EXPECT_EQ(count, 1);
}

TEST(Error, TextsNamePathAndKey) {
  const IoError io("a/b.jpg", "is empty");
  EXPECT_STREQ(io.what(), "a/b.jpg: is empty");
  EXPECT_EQ(io.path(), "a/b.jpg");
  EXPECT_EQ(io.reason(), "is empty");
  const ConfigError config("matching.max_ratio", "is wrong");
  EXPECT_STREQ(config.what(), "matching.max_ratio: is wrong");
  EXPECT_EQ(config.key(), "matching.max_ratio");
}

TEST(Types, PairIdsAreColmaps) {
  EXPECT_EQ(ImagePairToPairId(1, 2), 2147483649u);
  EXPECT_EQ(ImagePairToPairId(2, 1), ImagePairToPairId(1, 2));
  for (const image_t a : {1u, 5u, 70000u}) {
    for (const image_t b : {2u, 9u, 2147483646u}) {
      if (a == b) continue;
      const auto [id1, id2] = PairIdToImagePair(ImagePairToPairId(a, b));
      EXPECT_EQ(id1, std::min(a, b));
      EXPECT_EQ(id2, std::max(a, b));
    }
  }
}

}  // namespace
}  // namespace cairn
