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

}  // namespace
}  // namespace cairn
