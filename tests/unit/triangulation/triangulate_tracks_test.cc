#include "cairn/triangulation/triangulate_tracks.h"

#include "cairn/base/error.h"
#include "support/check_consistency.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"

namespace cairn {
namespace {

TEST(TriangulateTracks, RecoversThePointsOfADistortedScene) {
  for (int model_id = 0; model_id < kNumCameraModels; ++model_id) {
    const CameraModel model = *CameraModelFromId(model_id);
    SyntheticOptions synthetic;
    synthetic.model = model;
    const MadeReconstruction scene = MakeSyntheticScene(synthetic);
    Reconstruction estimate = scene.truth;
    const TriangulateTracksReport report =
        TriangulateTracks(scene.tracks, estimate, {}, {.num_threads = 1});
    CheckConsistency(estimate);
    EXPECT_EQ(report.num_points, static_cast<int64_t>(scene.tracks.size()));
    ASSERT_EQ(estimate.points3D.size(), scene.truth.points3D.size());
    for (const auto& [id, point] : estimate.points3D) {
      EXPECT_LT((point.xyz - scene.truth.points3D.at(id).xyz).norm(), 1e-7);
      EXPECT_EQ(point.track, scene.truth.points3D.at(id).track);
    }
  }
}

TEST(TriangulateTracks, LeavesOutWrongObservations) {
  SyntheticOptions synthetic;
  synthetic.num_images = 10;
  synthetic.noise_px = 0.5;
  synthetic.outlier_share = 0.15;
  const MadeReconstruction scene = MakeSyntheticScene(synthetic);
  Reconstruction estimate = scene.truth;
  const TriangulateTracksReport report =
      TriangulateTracks(scene.tracks, estimate, {}, {.num_threads = 2});
  CheckConsistency(estimate);
  EXPECT_GT(report.num_points, 190);
  int num_wrong = 0;
  for (const auto& [id, point] : estimate.points3D) {
    if (point.track.size() < 4) continue;
    double nearest = 1e9;
    for (const auto& [true_id, true_point] : scene.truth.points3D) {
      nearest = std::min(nearest, (point.xyz - true_point.xyz).norm());
    }
    num_wrong += nearest > 0.1;
  }
  EXPECT_EQ(num_wrong, 0);
  EXPECT_LT(estimate.MeanReprojectionErrorPx(), 1.0);
}

// 3 pixels off is much for a keypoint that is known within 0.2 and little for one within 2.
TEST(TriangulateTracks, AllowsErrorsInStandardDeviationsWhereTheyAreKnown) {
  const MadeReconstruction scene = MakeSyntheticScene({.num_images = 8});
  Reconstruction estimate = scene.truth;
  const Point3D& point = scene.truth.points3D.begin()->second;
  ASSERT_GE(point.track.size(), 4u);
  const TrackElement moved = point.track.front();
  estimate.images.at(moved.image_id).points2D[moved.point2D].x() += 3;
  for (auto& [id, image] : estimate.images) image.sigmas_px.assign(image.points2D.size(), 0.2f);
  const auto is_observed = [&](const Reconstruction& model) {
    return model.images.at(moved.image_id).point3D_ids[moved.point2D] != kInvalidPoint3DId;
  };
  TriangulationOptions filter;
  Reconstruction filtered = estimate;
  FilterPoints(filtered, filter, {.num_threads = 1});
  EXPECT_FALSE(is_observed(filtered));
  TriangulateTracks(scene.tracks, estimate, {}, {.num_threads = 1});
  EXPECT_FALSE(is_observed(estimate));

  estimate.images.at(moved.image_id)
      .sigmas_px.assign(estimate.images.at(moved.image_id).points2D.size(), 2.0f);
  TriangulateTracks(scene.tracks, estimate, {}, {.num_threads = 1});
  EXPECT_TRUE(is_observed(estimate));
  filtered = estimate;
  FilterPoints(filtered, filter, {.num_threads = 1});
  EXPECT_TRUE(is_observed(filtered));
  filter.max_error_sigmas = 1;
  FilterPoints(filtered, filter, {.num_threads = 1});
  EXPECT_FALSE(is_observed(filtered));
}

// In the corner of an action camera's picture 3 pixels are a dozen of the undistorted one.
TEST(TriangulateTracks, AllowsErrorsInPixelsOfThePictureWhereAWideLensSqueezesIt) {
  Reconstruction model;
  Camera camera = Camera::FromFocal(1, CameraModel::kFullOpenCV, 500, 1000, 750);
  camera.params[4] = 0.05;  // k1
  camera.params[9] = 0.35;  // k4, of the denominator
  model.cameras[1] = camera;
  const Eigen::Vector3d point(8, 6, 2);
  Track track;
  for (image_t id = 1; id <= 3; ++id) {
    RegisteredImage image;
    image.image.image_id = id;
    image.image.camera_id = 1;
    image.cam_from_world.translation.x() = id;
    const auto pixel = camera.ImgFromRay(image.cam_from_world * point);
    ASSERT_TRUE(pixel.has_value());
    image.points2D = {*pixel};
    image.point3D_ids = {kInvalidPoint3DId};
    model.images[id] = image;
    track.push_back({id, 0});
  }
  model.images.at(3).points2D[0] += Eigen::Vector2d(-1.8, 2.4);
  TriangulateTracks(std::vector<Track>{track}, model, {}, {.num_threads = 1});
  ASSERT_EQ(model.points3D.size(), 1u);
  EXPECT_EQ(model.points3D.begin()->second.track, track);
}

TEST(TriangulateTracks, DoesNotDependOnTheNumberOfThreads) {
  SyntheticOptions synthetic;
  synthetic.noise_px = 1;
  synthetic.outlier_share = 0.1;
  const MadeReconstruction scene = MakeSyntheticScene(synthetic);
  Reconstruction one = scene.truth;
  Reconstruction eight = scene.truth;
  TriangulateTracks(scene.tracks, one, {}, {.num_threads = 1});
  TriangulateTracks(scene.tracks, eight, {}, {.num_threads = 8});
  ASSERT_EQ(one.points3D.size(), eight.points3D.size());
  for (const auto& [id, point] : one.points3D) {
    EXPECT_EQ(point.xyz, eight.points3D.at(id).xyz);
    EXPECT_EQ(point.track, eight.points3D.at(id).track);
  }
}

TEST(TriangulateTracks, PassesOverImagesThatAreNotRegistered) {
  MadeReconstruction scene = MakeSyntheticScene({.num_images = 4});
  Reconstruction estimate = scene.truth;
  while (!estimate.points3D.empty()) estimate.RemovePoint3D(estimate.points3D.begin()->first);
  estimate.images.erase(2);
  TriangulateTracks(scene.tracks, estimate, {}, {.num_threads = 1});
  CheckConsistency(estimate);
  EXPECT_GT(estimate.points3D.size(), 100u);
  estimate.points3D.clear();
  estimate.images.erase(1);
  estimate.images.erase(3);
  const TriangulateTracksReport report =
      TriangulateTracks(scene.tracks, estimate, {}, {.num_threads = 1});
  EXPECT_EQ(report.num_points, 0);
  EXPECT_EQ(report.num_tracks, 0);
}

TEST(TriangulateTracks, RemainingObservationsGiveASecondPoint) {
  // Two points, their observations falsely joined to one track.
  const MadeReconstruction scene =
      MakeSyntheticScene({.num_images = 7, .num_points = 2, .visible_share = 1.0});
  Track joined;
  for (size_t i = 0; i < 7; ++i) joined.push_back(scene.tracks[i < 4 ? 0 : 1][i]);
  Reconstruction estimate = scene.truth;
  TriangulateTracks(std::span(&joined, 1), estimate, {}, {.num_threads = 1});
  ASSERT_EQ(estimate.points3D.size(), 2u);
  for (const auto& [id, point] : estimate.points3D) {
    EXPECT_LT((point.xyz - scene.truth.points3D.at(id).xyz).norm(), 1e-7);
  }
}

TEST(FilterPoints, RemovesWrongObservationsAndNarrowPoints) {
  MadeReconstruction scene = MakeSyntheticScene({.visible_share = 1.0});
  Reconstruction& model = scene.truth;
  // One wrong observation in point 1, all but one wrong in point 2, point 3 far behind.
  model.images.at(1).points2D[0].x() += 10;
  for (image_t i = 2; i <= 6; ++i) model.images.at(i).points2D[1].x() += 10.0 * i;
  model.points3D.at(3).xyz = Eigen::Vector3d(0, 0, -1000);
  const size_t num_points = model.points3D.size();
  const FilterReport report = FilterPoints(model, {}, {.num_threads = 2});
  CheckConsistency(model);
  EXPECT_EQ(model.points3D.at(1).track.size(), 5u);
  EXPECT_EQ(model.points3D.size(), num_points - 2);
  EXPECT_EQ(report.num_points_removed, 2);
  EXPECT_EQ(report.num_observations_removed, 1 + 5 + 6);

  TriangulationOptions wide;
  wide.min_angle_deg = 179;
  FilterPoints(model, wide, {.num_threads = 1});
  EXPECT_TRUE(model.points3D.empty());
}

TEST(FilterPoints, MinViewsRemovesShortTracks) {
  MadeReconstruction scene = MakeSyntheticScene({.visible_share = 0.5});
  TriangulationOptions options;
  options.min_views = 4;
  FilterPoints(scene.truth, options, {.num_threads = 1});
  EXPECT_FALSE(scene.truth.points3D.empty());
  for (const auto& [id, point] : scene.truth.points3D) EXPECT_GE(point.track.size(), 4u);
}

TEST(TriangulateTracks, RefusesMeaninglessOptions) {
  Reconstruction model;
  TriangulationOptions options;
  options.max_error_px = -1;
  EXPECT_THROW(TriangulateTracks({}, model, options), ConfigError);
  EXPECT_THROW(FilterPoints(model, options), ConfigError);
}

}  // namespace
}  // namespace cairn
