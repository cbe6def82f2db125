// Images that have a camera each, though one may have taken them all.
#include <cmath>
#include <set>

#include "mapper/stages.h"
#include "support/test.h"
#include "unit/mapper/camera_each.h"
#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {
namespace {

TEST(SharedCamera, IsFoundThoughEachImageHasItsOwn) {
  const SyntheticScene scene = SceneOfOneCamera();
  const ReconstructResult result = Reconstruct(WithACameraEach(scene, 1.4));
  ASSERT_EQ(result.models.size(), 1u);
  const Reconstruction& model = result.models.front();
  EXPECT_EQ(model.images.size(), 12u);
  EXPECT_EQ(model.cameras.size(), 12u);
  ASSERT_EQ(IntrinsicsOf(model).size(), 1u);
  const double focal = scene.cameras.at(1).MeanFocal();
  for (const auto& [id, image] : model.images) {
    EXPECT_EQ(image.image.camera_id, 100 + id);
    EXPECT_EQ(model.cameras.at(100 + id).camera_id, 100 + id);
    EXPECT_NEAR(model.cameras.at(100 + id).MeanFocal() / focal, 1.0, 0.01);
  }
  EXPECT_EQ(Value(*FindStage(result.report, "focal_calibration"), "sharing_disputed"), 0);
  // Separate cameras do not pay in these models, so that none are built for them.
  EXPECT_THAT(FindStage(result.report, "calibration_choice")->messages,
              ElementsAre(HasSubstr("with one camera for 12 images"),
                          HasSubstr("where these models have the cameras of"),
                          "the models are those with one camera for 12 images"));

  ReconstructSettings settings;
  settings.reconstruct.share_camera = false;
  EXPECT_EQ(IntrinsicsOf(Reconstruct(WithACameraEach(scene, 1.4), settings).models.front()).size(),
            12u);
}

// Pictures on their side are turned upright to be of one camera, and lie on their side in the
// model.
TEST(SharedCamera, TookUprightPicturesAndThoseOnTheirSide) {
  SyntheticScene scene = SceneOfOneCamera();
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(M_PI_2, Eigen::Vector3d::UnitZ()).matrix();
  Camera upright = scene.cameras.at(1);
  upright.camera_id = 2;
  std::swap(upright.width, upright.height);
  upright.params[1] = upright.width / 2.0;
  upright.params[2] = upright.height / 2.0;
  scene.cameras[2] = scene.truth.cameras[2] = upright;
  const std::set<image_t> turned = {1, 4, 5, 8, 11};
  for (const image_t id : turned) {
    scene.images[id - 1].camera_id = scene.truth.images.at(id).image.camera_id = 2;
    Rigid3d& pose = scene.truth.images.at(id).cam_from_world;
    pose = Rigid3d(turn, Eigen::Vector3d::Zero()) * pose;
    for (Keypoint& keypoint : scene.keypoints.at(id)) {
      keypoint = Keypoint{static_cast<float>(upright.width) - keypoint.y, keypoint.x};
    }
  }
  const ReconstructResult result = Reconstruct(WithACameraEach(scene, 1.4));
  ASSERT_EQ(result.models.size(), 1u);
  const Reconstruction& model = result.models.front();
  EXPECT_EQ(model.images.size(), 12u);
  EXPECT_THAT(FindStage(result.report, "calibration_choice")->messages,
              Contains("the models are those with one camera for 12 images"));
  for (const auto& [id, image] : model.images) {
    const Camera& camera = model.CameraOf(image);
    const Camera& truth = scene.cameras.at(turned.contains(id) ? 2 : 1);
    EXPECT_EQ(image.image.camera_id, 100 + id);
    EXPECT_EQ(camera.width, truth.width);
    EXPECT_EQ(camera.height, truth.height);
    EXPECT_EQ(camera.PrincipalPoint(), truth.PrincipalPoint());
    EXPECT_EQ(camera.MeanFocal(), model.cameras.at(101).MeanFocal());
    EXPECT_NEAR(camera.MeanFocal() / truth.MeanFocal(), 1.0, 0.01);
    for (size_t i = 0; i < image.points2D.size(); ++i) {
      EXPECT_EQ(image.points2D[i], scene.keypoints.at(id)[i].Position());
    }
  }
  for (const ViewEdge& edge : result.graph.edges) {
    const auto error = [&](const Reconstruction& poses) {
      const Rigid3d& pose1 = poses.images.at(edge.image_id1).cam_from_world;
      const Rigid3d& pose2 = poses.images.at(edge.image_id2).cam_from_world;
      return (pose2 * Inverse(pose1)).rotation.angularDistance(edge.cam2_from_cam1.rotation);
    };
    EXPECT_LT(error(model), 0.2) << edge.image_id1 << " " << edge.image_id2;
    EXPECT_LT(error(scene.truth), 0.2) << edge.image_id1 << " " << edge.image_id2;
  }
}

// With EXIF the cameras of the database are tried first; what the models found is shared.
TEST(SharedCamera, OfOnePriorFocalLengthIsFound) {
  const SyntheticScene scene = SceneOfOneCamera();
  const ReconstructResult result = Reconstruct(WithACameraEach(scene, 1.01, true));
  ASSERT_EQ(result.models.size(), 1u);
  EXPECT_EQ(IntrinsicsOf(result.models.front()).size(), 1u);
}

// Photographs of other places do not outvote those that belong together.
TEST(SharedCamera, IsFoundBesideImagesWithoutPairs) {
  const SyntheticScene scene = SceneOfOneCamera();
  Database database = WithACameraEach(scene, 1.4);
  for (image_t id = 201; id <= 214; ++id) {
    Camera camera = database.ReadCameras().back();
    camera.camera_id = id;
    database.WriteCamera(camera);
    database.WriteImage({id, "other" + std::to_string(id), id});
    database.WriteKeypoints(id, scene.keypoints.at(1));
  }
  const ReconstructResult result = Reconstruct(database);
  ASSERT_EQ(result.models.size(), 1u);
  EXPECT_EQ(IntrinsicsOf(result.models.front()).size(), 1u);
}

// Every image zoomed by a few percent of its own.
TEST(SharedCamera, IsNotForcedOnImagesOfSeveral) {
  const SyntheticScene scene = SceneOfOneCamera();
  Database database = WithACameraEach(scene, 1.2);
  const std::map<image_t, double> zoom = ZoomEach(scene, database);
  const ReconstructResult result = Reconstruct(database);
  ASSERT_EQ(result.models.size(), 1u);
  EXPECT_EQ(result.models.front().images.size(), 12u);
  EXPECT_THAT(FindStage(result.report, "calibration_choice")->messages,
              Contains(HasSubstr("evidence with the cameras of the database")));
  for (const auto& [id, image] : result.models.front().images) {
    const double focal = result.models.front().cameras.at(100 + id).MeanFocal();
    EXPECT_NEAR(focal / scene.cameras.at(1).MeanFocal(), zoom.at(id), 0.02);
  }
}

// Where image centers move, as those of stabilized lenses do, separate focal lengths absorb some of
// that: they have more evidence, but pairs find others.
TEST(SharedCamera, StaysWhereFocalLengthsAbsorbOtherErrors) {
  const SyntheticScene scene = SceneOfOneCamera();
  Database database = WithACameraEach(scene, 1.2);
  const double focal = scene.cameras.at(1).MeanFocal();
  for (const Image& image : scene.images) {
    const double x = 0.06 * focal * std::sin(5.0 * image.image_id);
    const Eigen::Vector2d off(x, -x * std::cos(7.0 * image.image_id));
    MoveKeypoints(scene, image.image_id, database,
                  [&](const Eigen::Vector2d& pixel) { return pixel + off; });
  }
  const ReconstructResult result = Reconstruct(database);
  ASSERT_EQ(result.models.size(), 1u);
  EXPECT_THAT(
      FindStage(result.report, "calibration_choice")->messages,
      testing::IsSupersetOf({HasSubstr("with one camera for 12 images"),
                             HasSubstr("where these models have the cameras of"),
                             HasSubstr("pairs do not confirm the focal lengths of these models")}));
  EXPECT_EQ(IntrinsicsOf(result.models.front()).size(), 1u);
}

TEST(SharedCamera, IsLeftWherePairsConfirmTheFocalLengthsOfModels) {
  SceneData scene;
  Reconstruction model;
  for (camera_t id = 1; id <= 6; ++id) {
    model.cameras[id] =
        Camera::FromFocal(id, CameraModel::kSimpleRadial, 1000 + 10 * id, 1600, 1200);
    scene.focals_by_pairs[id].sigma = 0.03;
  }
  const auto are_confirmed = [&](const auto& focal_by_pairs) {
    for (auto& [id, focal] : scene.focals_by_pairs) focal.focal_px = focal_by_pairs(id);
    return PairsConfirmFocals(scene, std::vector{model});
  };
  EXPECT_TRUE(are_confirmed([](double id) { return 1000 + 10 * id; }));
  EXPECT_TRUE(are_confirmed([](double id) { return 1.2 * (1000 + 10 * id); }));
  EXPECT_FALSE(are_confirmed([](double) { return 1000; }));
  EXPECT_FALSE(are_confirmed([](double id) { return 1000 - 10 * id; }));
  EXPECT_FALSE(are_confirmed([](double id) { return 1000 + 2 * id; }));
  EXPECT_FALSE(are_confirmed([](double id) { return 1000 + 50 * id; }));
  EXPECT_FALSE(PairsConfirmFocals(SceneData(), std::vector{model}));
}

// By a lens that was zoomed in between, which pairs tell: separate cameras are tried whatever
// became of the models of one.
TEST(SharedCamera, IsDisputedByPairsOfTwoLenses) {
  const SyntheticScene scene = SceneOfOneCamera();
  Database database = WithACameraEach(scene, 1.2);
  for (image_t id = 2; id <= 12; id += 2) Zoom(scene, id, 0.6, database);
  const ReconstructResult result = Reconstruct(database);
  EXPECT_EQ(Value(*FindStage(result.report, "focal_calibration"), "sharing_disputed"), 1);
  ASSERT_EQ(result.models.size(), 1u);
  for (const auto& [id, image] : result.models.front().images) {
    const double focal = result.models.front().cameras.at(100 + id).MeanFocal();
    EXPECT_NEAR(focal / scene.cameras.at(1).MeanFocal(), id % 2 == 0 ? 0.6 : 1.0, 0.02);
  }
}

TEST(SharedCamera, StaysSharedInAModelThatGrows) {
  const SyntheticScene scene = SceneOfOneCamera();
  const Database all = WithACameraEach(scene, 1.4);
  Database before = WithACameraEach(scene, 1.4);
  before.DeleteImagesAndPairs({4, 8, 12});
  const ReconstructResult earlier = Reconstruct(before);
  ASSERT_EQ(earlier.models.size(), 1u);
  const ReconstructResult result = Reconstruct(all, "", {}, kOneThread, earlier.models);
  ASSERT_EQ(result.models.size(), 1u);
  EXPECT_EQ(result.models.front().images.size(), 12u);
  EXPECT_EQ(IntrinsicsOf(result.models.front()).size(), 1u);
}

// An image of an earlier model whose pairs are gone has the camera of one that shares its own.
TEST(SharedCamera, OfAnEarlierModelMayBeThatOfAnImageWithoutPairs) {
  const SyntheticScene scene = SceneOfOneCamera();
  Database database = WithACameraEach(scene, 1.4);
  std::vector<Reconstruction> earlier = Reconstruct(database).models;
  ASSERT_EQ(earlier.size(), 1u);
  database.WriteImage({99, "alone.jpg", 105});
  database.WriteKeypoints(99, scene.keypoints.at(5));
  RegisteredImage alone = earlier.front().images.at(5);
  alone.image = {99, "alone.jpg", 105};
  alone.point3D_ids.assign(alone.point3D_ids.size(), kInvalidPoint3DId);
  earlier.front().images[99] = alone;
  const ReconstructResult result = Reconstruct(database, "", {}, kOneThread, earlier);
  ASSERT_EQ(result.models.size(), 1u) << result.report.failure;
  EXPECT_EQ(result.models.front().images.size(), 12u);
}

TEST(SharedCamera, EarlierModelsTellOnlyWhereTheyHaveSeveralOfTheImages) {
  const SyntheticScene synthetic = SceneOfOneCamera();
  SceneData scene;
  for (const Image& image : synthetic.images) scene.images[image.image_id] = image;
  Reconstruction model = synthetic.truth;
  EXPECT_TRUE(AgreeWithOneCamera(std::vector{model}, {1, 2, 3}, scene));
  model.cameras[2] = model.cameras.at(1);
  model.images.at(2).image.camera_id = 2;
  EXPECT_TRUE(AgreeWithOneCamera(std::vector{model}, {1, 2, 3}, scene));
  model.cameras[2].SetMeanFocal(1.1 * model.cameras[2].MeanFocal());
  EXPECT_FALSE(AgreeWithOneCamera(std::vector{model}, {1, 2, 3}, scene));
  EXPECT_FALSE(AgreeWithOneCamera(std::vector{model}, {1}, scene));
  EXPECT_FALSE(AgreeWithOneCamera({}, {1, 2, 3}, scene));
}

// Five images with a camera each, every one with pairs to all others.
SceneData SceneOfKinds() {
  SceneData scene;
  for (image_t id = 1; id <= 5; ++id) {
    scene.images[id].camera_id = id;
    scene.pixels[id];
    scene.cameras[id] = Camera::FromFocal(id, CameraModel::kSimpleRadial, 900 + id, 800, 600);
    for (image_t other = 1; other < id; ++other) {
      scene.edges.emplace_back();
      scene.edges.back().image_id1 = other;
      scene.edges.back().image_id2 = id;
    }
  }
  return scene;
}

TEST(SharedCamera, NeedsMostImagesOfOneKind) {
  using Groups = std::vector<std::set<image_t>>;
  SceneData scene = SceneOfKinds();
  EXPECT_EQ(LikelyOfOneCamera(scene), (Groups{{1, 2, 3, 4, 5}}));
  scene.cameras[1].width = 600;
  scene.cameras[2].has_prior_focal_length = true;
  EXPECT_EQ(LikelyOfOneCamera(scene), (Groups{{3, 4, 5}}));
  scene.constant_cameras = {3};
  EXPECT_TRUE(LikelyOfOneCamera(scene).empty());
  scene.constant_cameras = {};
  scene.images[4].camera_id = scene.images[5].camera_id = 3;
  EXPECT_TRUE(LikelyOfOneCamera(scene).empty());
  // Three images have one camera already, two more cameras are of its kind.
  scene.cameras[1] = scene.cameras[2] = scene.cameras[3];
  EXPECT_EQ(LikelyOfOneCamera(scene), (Groups{{1, 2, 3, 4, 5}}));
  scene.images[2].camera_id = 3;
  EXPECT_TRUE(LikelyOfOneCamera(scene).empty());
}

// By one lens, upright and on its side, or by two phones: a group for each size.
TEST(SharedCamera, OfEverySizeThatIsFrequentIsLikely) {
  using Groups = std::vector<std::set<image_t>>;
  SceneData scene = SceneOfKinds();
  for (const image_t id : {4, 5}) std::swap(scene.cameras[id].width, scene.cameras[id].height);
  EXPECT_EQ(LikelyOfOneCamera(scene), (Groups{{4, 5}, {1, 2, 3}}));
  scene.cameras[1].height = 700;  // the only one
  EXPECT_EQ(LikelyOfOneCamera(scene), (Groups{{4, 5}, {2, 3}}));
  for (const image_t id : {4, 5}) scene.cameras[id].width = 640;
  EXPECT_EQ(LikelyOfOneCamera(scene), (Groups{{4, 5}, {2, 3}}));
  // Of many sizes none is.
  scene.cameras[2].height = 500;
  EXPECT_TRUE(LikelyOfOneCamera(scene).empty());
}

TEST(SharedCamera, OfEveryPlaceInTheFolderIsLikely) {
  using Groups = std::vector<std::set<image_t>>;
  SceneData scene = SceneOfKinds();
  for (const image_t id : {4, 5}) scene.cameras[id].width = id * 100;
  EXPECT_EQ(LikelyOfOneCamera(scene), (Groups{{1, 2, 3}}));
  for (const image_t id : {4, 5}) scene.cameras[id].width = 640;
  std::erase_if(scene.edges, [](const ViewEdge& edge) {
    return (edge.image_id1 <= 3) != (edge.image_id2 <= 3);
  });
  EXPECT_EQ(LikelyOfOneCamera(scene), (Groups{{4, 5}, {1, 2, 3}}));
  // Images without pairs have no part in it.
  for (const image_t id : {1, 2, 3}) scene.cameras[id].width = 640;
  scene.cameras[1].has_prior_focal_length = true;
  scene.edges.pop_back();
  EXPECT_EQ(LikelyOfOneCamera(scene), (Groups{{2, 3}}));
}

}  // namespace
}  // namespace cairn
