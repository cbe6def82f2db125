#include "unit/mapper/incomplete_model.h"

namespace cairn {
namespace {

// Directions of all pairs and global rotations, as they are, with a tenth of wrong matches.
struct Baselines : IncompleteModel {
  Baselines() : IncompleteModel({}) {
    for (const auto& [id, image] : truth.images) {
      rotations[id] = image.cam_from_world.rotation;
      centers[id] = image.cam_from_world.Center();
    }
    for (const ViewEdge& edge : graph.edges) {
      directions.push_back({edge.image_id1, edge.image_id2,
                            (centers[edge.image_id2] - centers[edge.image_id1]).normalized()});
      FeatureMatches& matches = scene.matches.at(edge.PairId());
      for (size_t i = 0; i + 3 < matches.size(); i += 20) {
        std::swap(matches[i].point2, matches[i + 2].point2);
      }
    }
  }
  double TrueLength(const DirectionEdge& edge) {
    return (centers[edge.image_id2] - centers[edge.image_id1]).norm();
  }

  std::map<image_t, Eigen::Quaterniond> rotations;
  std::map<image_t, Eigen::Vector3d> centers;
  std::vector<DirectionEdge> directions;
};

TEST(BaselineLengths, AreTheTrueOnesInAnyUnit) {
  Baselines scene;
  FindBaselineLengths(scene.context, scene.rotations, scene.directions);
  const double unit = scene.directions[0].length / scene.TrueLength(scene.directions[0]);
  ASSERT_GT(unit, 0);
  for (const DirectionEdge& edge : scene.directions) {
    EXPECT_NEAR(edge.length / scene.TrueLength(edge), unit, 0.02 * unit);
    EXPECT_GT(edge.num_points, 10);
  }
}

TEST(BaselineLengths, OneWrongDirectionHarmsNoOther) {
  Baselines scene;
  DirectionEdge& wrong = scene.directions[3];
  wrong.direction = Eigen::Vector3d(wrong.direction.y(), wrong.direction.z(), wrong.direction.x());
  FindBaselineLengths(scene.context, scene.rotations, scene.directions);
  const double unit = scene.directions[0].length / scene.TrueLength(scene.directions[0]);
  for (const DirectionEdge& edge : scene.directions) {
    if (&edge == &wrong) continue;
    EXPECT_NEAR(edge.length / scene.TrueLength(edge), unit, 0.02 * unit);
  }
}

TEST(BaselineLengths, PairsWithoutCommonPointsHaveNone) {
  Baselines scene;
  // The matches of two pairs alone stay, which share no image.
  const std::vector<DirectionEdge> two = {scene.directions[0], scene.directions.back()};
  ASSERT_NE(two[0].image_id1, two[1].image_id1);
  ASSERT_NE(two[0].image_id2, two[1].image_id2);
  scene.directions = two;
  FindBaselineLengths(scene.context, scene.rotations, scene.directions);
  for (const DirectionEdge& edge : scene.directions) EXPECT_EQ(edge.length, 0);
}

TEST(BaselineLengths, AreEqualForAnyNumberOfThreads) {
  Baselines one, many;
  many.context.run.num_threads = 3;
  FindBaselineLengths(one.context, one.rotations, one.directions);
  FindBaselineLengths(many.context, many.rotations, many.directions);
  for (size_t e = 0; e < one.directions.size(); ++e) {
    EXPECT_EQ(one.directions[e].length, many.directions[e].length);
  }
}

}  // namespace
}  // namespace cairn
