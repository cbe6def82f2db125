#include "translation_averaging/rigidity.h"

#include "cairn/base/rng.h"
#include "support/parallel_rigid_components.h"
#include "support/test.h"

namespace cairn {
namespace {

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

// Most cameras are placed by growing; the others, at its border, as by the pebble game over all.
TEST(Rigidity, AgreesWithThePebbleGameOverAll) {
  for (uint64_t seed = 0; seed < 200; ++seed) {
    Rng rng(seed);
    const int num_cameras = 8 + static_cast<int>(rng.UniformInt(30));
    std::vector<std::pair<int, int>> edges;
    const auto add = [&](int num, int from, int to) {
      for (int k = 0; k < num; ++k) {
        const int a = from + static_cast<int>(rng.UniformInt(to - from));
        const int b = from + static_cast<int>(rng.UniformInt(to - from));
        if (a != b) edges.emplace_back(std::min(a, b), std::max(a, b));
      }
    };
    add(2 * num_cameras, 0, num_cameras / 2);  // a dense part and a loose one
    add(num_cameras / 2, 0, num_cameras);
    std::vector<GraphEdge> graph_edges;
    for (const auto& [a, b] : edges) graph_edges.push_back({a, b});
    const auto components = ParallelRigidComponents(num_cameras, graph_edges);
    const std::vector<int> placeable = Placeable(edges, {});
    EXPECT_EQ(placeable.size(), components.empty() ? 0 : components[0].size()) << seed;
  }
}

}  // namespace
}  // namespace cairn
