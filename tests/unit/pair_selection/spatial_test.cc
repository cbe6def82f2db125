#include "cairn/pair_selection/pair_selection.h"
#include "support/test.h"

namespace cairn {
namespace {

using ::testing::IsSupersetOf;

// One minute of latitude is 1852 m within 10 m, wherever it is.
TEST(Spatial, NearestWithinTheRadius) {
  constexpr double kMinute = 1.0 / 60;
  const std::map<image_t, GpsPosition> positions = {{1, {50, 10, 0}},
                                                    {2, {50 + kMinute, 10, 500}},
                                                    {3, {50 + 3 * kMinute, 10, 0}},
                                                    {4, {50 + 7 * kMinute, 10, 0}}};
  const auto pair = ImagePairToPairId;
  EXPECT_THAT(SpatialPairs(positions, 1, 1e6, 1), ElementsAre(pair(1, 2), pair(2, 3), pair(3, 4)));
  EXPECT_THAT(SpatialPairs(positions, 3, 1840, 1), ElementsAre());
  EXPECT_THAT(SpatialPairs(positions, 3, 1864, 1), ElementsAre(pair(1, 2)));
  EXPECT_THAT(SpatialPairs(positions, 3, 3730, 2), ElementsAre(pair(1, 2), pair(2, 3)));
  EXPECT_EQ(SpatialPairs(positions, 3, 1e6, 2).size(), 6u);
}

// As all photographs of a room may have them.
TEST(Spatial, OfEqualPositionsTheNextByNameAreTaken) {
  std::map<image_t, GpsPosition> positions;
  for (image_t id = 1; id <= 9; ++id) positions[id] = {48, 11, 0};
  const auto pair = ImagePairToPairId;
  EXPECT_THAT(SpatialPairs(positions, 2, 1e6, 1),
              IsSupersetOf({pair(1, 2), pair(4, 5), pair(5, 6), pair(8, 9)}));
  EXPECT_EQ(SpatialPairs(positions, 2, 1e6, 1).size(), 8u + 2u);  // and two from the ends
}

// A receiver without a fix repeats its last one.
TEST(Spatial, ManyOfOnePositionDoNotHideTheNextOne) {
  std::map<image_t, GpsPosition> positions;
  for (image_t id = 1; id <= 9; ++id) positions[id] = {48, id < 6 ? 11 : 11.0001, 0};
  const auto pair = ImagePairToPairId;
  EXPECT_THAT(SpatialPairs(positions, 2, 1e6, 1),
              IsSupersetOf({pair(1, 6), pair(5, 6), pair(4, 5), pair(6, 7)}));
}

TEST(Spatial, TheDateLineIsNoBorder) {
  const std::map<image_t, GpsPosition> positions = {{1, {0, 179.9999, 0}}, {2, {0, -179.9999, 0}}};
  EXPECT_EQ(SpatialPairs(positions, 1, 23, 1).size(), 1u);  // 22.26 m of the equator
  EXPECT_EQ(SpatialPairs(positions, 1, 22, 1).size(), 0u);
}

}  // namespace
}  // namespace cairn
