#include "math/random_vectors.h"
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

TEST(RefineModel, NothingIsDoneForAModelWithoutImages) {
  IncompleteModel scene({});
  const std::vector<Track> tracks = TracksOfGraph(scene.context, scene.graph).tracks;
  scene.model = {};
  EXPECT_FALSE(RefineModel(scene.context, tracks, RefineStart::kChanged, scene.model));
  EXPECT_EQ(FindStage(scene.report, "bundle_adjustment"), nullptr);
}

double MeanRotationErrorDeg(const IncompleteModel& scene) {
  double sum = 0;
  for (const ViewEdge& edge : scene.scene.edges) {
    const Rigid3d pose = scene.truth.images.at(edge.image_id2).cam_from_world *
                         Inverse(scene.truth.images.at(edge.image_id1).cam_from_world);
    sum += RadToDeg(AngleBetween(pose.rotation, edge.cam2_from_cam1.rotation));
  }
  return sum / static_cast<double>(scene.scene.edges.size());
}

// Of focal lengths that are wrong by a third, and of those that a model found for all but two
// photographs. What was known of cameras stays known.
TEST(TakeIntrinsics, GivesPairsPosesByWhatModelsFound) {
  IncompleteModel scene({1, 2});
  SceneData& data = scene.scene;
  data.edges = scene.graph.edges;
  data.stored_geometry = [](image_pair_t) { return TwoViewGeometry(); };
  std::set<camera_t> all;
  for (auto& [id, camera] : data.cameras) {
    camera.SetMeanFocal(1.3 * camera.MeanFocal());
    all.insert(id);
  }
  data.constant_cameras = {data.CameraIdOf(3)};
  ImproveRelativePoses(ReadGeometriesOf(all, data), kOneThread, data);
  const double before_deg = MeanRotationErrorDeg(scene);
  const std::map<camera_t, Camera> known = data.cameras;

  ASSERT_TRUE(TakeIntrinsics({&scene.model, 1}, kOneThread, data));
  EXPECT_LT(MeanRotationErrorDeg(scene), 0.7 * before_deg);
  for (const auto& [id, image] : scene.truth.images) {
    const camera_t camera_id = data.CameraIdOf(id);
    const bool is_found = id > 3;
    EXPECT_EQ(data.cameras.at(camera_id).params,
              is_found ? scene.model.cameras.at(camera_id).params : known.at(camera_id).params);
    EXPECT_EQ(data.KnownCamera(camera_id).params, known.at(camera_id).params);
  }
  EXPECT_FALSE(TakeIntrinsics({&scene.model, 1}, kOneThread, data));
}

// A place whose photographs mostly left it, beside a larger one where one did.
TEST(ImagesThatLeftExif, AreThoseOfModelsThatMostlyDid) {
  IncompleteModel scene({});
  std::vector<Reconstruction> models(2, scene.model);
  for (const image_t id : {1, 2, 3, 4}) RemoveImage(id, models[0]);
  for (const image_t id : {5, 6, 7, 8, 9, 10}) RemoveImage(id, models[1]);
  const auto leave = [&](image_t id, Reconstruction& model) {
    Camera& camera = model.cameras.at(scene.scene.CameraIdOf(id));
    camera.SetMeanFocal(2 * camera.MeanFocal());
  };
  leave(5, models[0]);
  EXPECT_TRUE(ImagesThatLeftExif(scene.scene, 0.1, models).empty());
  for (const image_t id : {1, 2, 3}) leave(id, models[1]);
  EXPECT_EQ(ImagesThatLeftExif(scene.scene, 0.1, models), (std::set<image_t>{1, 2, 3}));
}

// A walk past a wall, before a skyline that every image shows: images from x = 0 to 5.5 look along
// y at points nearby, and at num_far ones far away.
struct Walk {
  explicit Walk(int num_far, double near_deg = 0) {
    constexpr int kNumImages = 12, kNumNear = 2000;
    const Camera camera = Camera::FromFocal(1, CameraModel::kPinhole, 800, 1000, 800);
    scene.cameras[1] = model.cameras[1] = camera;
    Rng rng(1);
    std::vector<Eigen::Vector3d> points;
    const double depth = near_deg > 0 ? 5.5 / DegToRad(near_deg) : 3;
    const double side = near_deg > 0 ? 0.5 * depth : 5;
    for (int i = 0; i < kNumNear + num_far; ++i) {
      points.push_back(
          i < kNumNear
              ? UniformVector({{3 - side, 3 + side}, {-1, 1}, {depth, 1.2 * depth}}, rng)
              : Eigen::Vector3d(1e5 * UniformVector({{-0.5, 0.5}, {-0.4, 0.4}, {1, 1}}, rng)));
    }
    tracks.resize(points.size());
    for (image_t id = 1; id <= kNumImages; ++id) {
      RegisteredImage& image = model.images[id];
      image.image = scene.images[id] = {id, std::to_string(id) + ".jpg", 1};
      image.cam_from_world = Rigid3d(Eigen::Quaterniond::Identity(), {-0.5 * (id - 1.0), 0, 0});
      for (size_t i = 0; i < points.size(); ++i) {
        const Eigen::Vector3d x = image.cam_from_world * points[i];
        const Eigen::Vector2d pixel =
            camera.ImgFromCam(x.hnormalized()) + 0.5 * GaussianVector<2>(rng);
        if (!(Eigen::Array2d(0, 0) < pixel.array()).all() ||
            !(pixel.array() < Eigen::Array2d(1000, 800)).all()) {
          continue;
        }
        tracks[i].push_back({id, static_cast<point2D_t>(image.points2D.size())});
        image.points2D.push_back(pixel);
      }
      image.point3D_ids.assign(image.points2D.size(), kInvalidPoint3DId);
      scene.pixels[id] = image.points2D;
      scene.scales[id].assign(image.points2D.size(), 2.0f);
    }
    std::erase_if(tracks, [](const Track& track) { return track.size() < 2; });
  }

  SceneData scene;
  Reconstruction model;
  std::vector<Track> tracks;
  ReconstructSettings settings;
  RunReport report;
  StageContext context{scene, settings, kOneThread, report};
};

// The longest tracks are those of the skyline, whose points have no distance.
TEST(FindStart, AFarBackgroundDoesNotHideWhatIsNear) {
  Walk walk(600);
  FindStart(walk.context, walk.tracks, walk.model);
  EXPECT_EQ(walk.model.images.size(), 12u);
  EXPECT_EQ(walk.context.min_angle_deg, 1.5);
}

// Small angles are large beside the noise of keypoints.
TEST(FindStart, PointsMayHaveSmallAnglesWhereMostHave) {
  Walk walk(0, 0.8);
  FindStart(walk.context, walk.tracks, walk.model);
  EXPECT_GT(walk.context.min_angle_deg, 0.3);
  EXPECT_LT(walk.context.min_angle_deg, 0.45);
  RefineModel(walk.context, walk.tracks, RefineStart::kChanged, walk.model);
  EXPECT_EQ(walk.model.images.size(), 12u);
  EXPECT_GT(walk.model.points3D.size(), 0.4 * walk.tracks.size());
}

}  // namespace
}  // namespace cairn
