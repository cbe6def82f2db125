#include "unit/mapper/incomplete_model.h"

namespace cairn {
namespace {

TEST(RefineModel, ARefinedModelStaysUnlessTracksBringObservations) {
  IncompleteModel scene({});
  const std::vector<Track> tracks = TracksOfGraph(scene.context, scene.graph).tracks;
  const std::vector<Track> half(tracks.begin(), tracks.begin() + std::ssize(tracks) / 2);
  EXPECT_TRUE(RefineModel(scene.context, half, RefineStart::kChanged, scene.model));
  const Reconstruction refined = scene.model;
  EXPECT_FALSE(RefineModel(scene.context, half, RefineStart::kRefined, scene.model));
  EXPECT_EQ(scene.model.NumObservations(), refined.NumObservations());
  for (const auto& [id, image] : scene.model.images) {
    EXPECT_EQ(image.cam_from_world.translation, refined.images.at(id).cam_from_world.translation);
  }
  EXPECT_TRUE(RefineModel(scene.context, tracks, RefineStart::kRefined, scene.model));
  EXPECT_GT(scene.model.NumObservations(), 1.5 * refined.NumObservations());
}

// A weak model may fall apart where more matches come in.
TEST(RefineModel, MatchesThatMovedIntrinsicsBringCostNoImages) {
  IncompleteModel scene({});
  for (auto& [id, camera] : scene.scene.cameras) camera.params[0] *= 1.1;
  scene.scene.raw_matches = [all = scene.scene.matches](const ViewEdge& edge) {
    return all.at(edge.PairId());
  };
  for (auto& [pair, matches] : scene.scene.matches) matches.resize(matches.size() / 2);
  const std::vector<Track> tracks = TracksOfGraph(scene.context, scene.graph).tracks;
  ASSERT_TRUE(RefineModel(scene.context, tracks, RefineStart::kChanged, scene.model));
  const Reconstruction before = scene.model;
  ASSERT_TRUE(RefineWithMovedIntrinsics(scene.context, scene.graph, scene.model));
  EXPECT_GT(scene.model.NumObservations(), 1.2 * before.NumObservations());

  scene.model = before;
  scene.settings.reconstruct.min_image_points = 1'000'000;
  ASSERT_TRUE(RefineWithMovedIntrinsics(scene.context, scene.graph, scene.model));
  EXPECT_EQ(scene.model.images.size(), before.images.size());
  EXPECT_EQ(scene.model.NumObservations(), before.NumObservations());
}

}  // namespace
}  // namespace cairn
