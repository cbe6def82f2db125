#include "translation_averaging/rigidity.h"

#include <gmock/gmock.h>

namespace cairn {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

std::vector<int> Placeable(const std::vector<std::pair<int, int>>& edges,
                           const std::vector<std::vector<int>>& tracks) {
  std::vector<DirectionEdge> direction_edges;
  for (const auto& [a, b] : edges) {
    direction_edges.push_back({static_cast<image_t>(a), static_cast<image_t>(b)});
  }
  std::vector<PointDirections> points;
  for (const std::vector<int>& track : tracks) {
    points.emplace_back();
    for (const int camera : track) points.back().rays.push_back({static_cast<image_t>(camera)});
  }
  const DirectionProblem problem = MakeDirectionProblem(direction_edges, points);
  std::vector<int> ids;
  for (const int camera :
       LargestPlaceableSet(problem, std::vector<char>(problem.edges.size(), 0))) {
    ids.push_back(static_cast<int>(problem.image_ids[camera]));
  }
  return ids;
}

TEST(Rigidity, EdgesAlone) {
  EXPECT_THAT(Placeable({}, {}), IsEmpty());
  EXPECT_THAT(Placeable({{1, 2}}, {}), ElementsAre(1, 2));
  EXPECT_THAT(Placeable({{1, 2}, {2, 3}}, {}), ElementsAre(1, 2));
  EXPECT_THAT(Placeable({{1, 2}, {2, 3}, {1, 3}, {3, 4}}, {}), ElementsAre(1, 2, 3));
}

// A point seen by 1, 2, 3 makes two triangles with a common side out of the chain.
TEST(Rigidity, APointTiesAChain) {
  EXPECT_THAT(Placeable({{1, 2}, {2, 3}}, {{1, 2, 3}}), ElementsAre(1, 2, 3));
  // One seen by 1 and 3 only closes the chain to a loop of four, which is rigid in space too.
  EXPECT_THAT(Placeable({{1, 2}, {2, 3}}, {{1, 3}}), ElementsAre(1, 2, 3));
  EXPECT_THAT(Placeable({{1, 2}, {2, 3}}, {{1, 2}}), ElementsAre(1, 2));
}

TEST(Rigidity, PointsAlone) {
  EXPECT_THAT(Placeable({}, {{1, 2}}), IsEmpty());
  EXPECT_THAT(Placeable({}, {{1, 2}, {1, 2}}), ElementsAre(1, 2));
  EXPECT_THAT(Placeable({}, {{1, 2, 3}, {1, 2, 3}}), ElementsAre(1, 2, 3));
}

TEST(Rigidity, TwoPlacesThatShareOneCamera) {
  EXPECT_THAT(Placeable({{1, 2}, {2, 3}, {1, 3}, {3, 4}, {4, 5}, {3, 5}, {5, 6}, {4, 6}}, {}),
              ElementsAre(3, 4, 5, 6));
}

}  // namespace
}  // namespace cairn
