#include <map>
#include <set>

#include "mapper/stages.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {
namespace {

// One camera of unknown focal length, whose principal point lies so far off the center, where the
// database has it.
Database MakeDatabaseOffCenter(const Eigen::Vector2f& offset_px) {
  SceneOptions options = SmallScene();
  options.num_images = 14;
  options.num_cameras = 1;
  SyntheticScene scene = MakeScene(options, 3);
  for (auto& [id, keypoints] : scene.keypoints) {
    for (Keypoint& keypoint : keypoints) {
      keypoint.x += offset_px.x();
      keypoint.y += offset_px.y();
    }
  }
  return MakeDatabaseWithGuesses(scene, 1.02);
}

Eigen::Vector2d OffsetFromCenter(const ReconstructResult& result) {
  const Camera& camera = result.models.front().cameras.begin()->second;
  return camera.PrincipalPoint() - Eigen::Vector2d(0.5 * camera.width, 0.5 * camera.height);
}

double ErrorsOfPrincipalPoints(const ReconstructResult& result) {
  return Value(*FindStage(result.report, "principal_points"), "standard_errors_of_gain");
}

// Where bundle adjustment finds the principal point, from the center, pixels.
double FoundOffset(const ReconstructResult& result) {
  Eigen::Vector2d found, center;
  const std::string& message = FindStage(result.report, "principal_points")->messages.at(0);
  std::sscanf(message.c_str(), "camera %*d: principal point (%lf, %lf) in place of (%lf, %lf)",
              &found.x(), &found.y(), &center.x(), &center.y());
  return (found - center).norm();
}

// Two standard errors.
const Eigen::Vector2f kHardlyOff(1.45F, -0.9F);

TEST(Reconstruct, RefinesPrincipalPointsOfUnknownCamerasWhereTheMatchesTell) {
  const ReconstructResult refined = Reconstruct(MakeDatabaseOffCenter({14, -9}));
  ASSERT_TRUE(refined.report.Succeeded()) << refined.report.failure;
  EXPECT_LT((OffsetFromCenter(refined) - Eigen::Vector2d(14, -9)).norm(), 6);
  EXPECT_TRUE(refined.report.warnings.empty());

  const ReconstructResult barely = Reconstruct(MakeDatabaseOffCenter(kHardlyOff));
  ASSERT_TRUE(barely.report.Succeeded()) << barely.report.failure;
  EXPECT_LT((OffsetFromCenter(barely) - kHardlyOff.cast<double>()).norm(), 6);
  EXPECT_NE(OffsetFromCenter(barely), Eigen::Vector2d::Zero());
  EXPECT_LT(ErrorsOfPrincipalPoints(barely), 3);

  const ReconstructResult centered = Reconstruct(MakeDatabaseOffCenter({0, 0}));
  ASSERT_TRUE(centered.report.Succeeded()) << centered.report.failure;
  EXPECT_LT(OffsetFromCenter(centered).norm(), 6);
  EXPECT_LT(ErrorsOfPrincipalPoints(centered), 3);
  // Where the photographs hardly tell, it stays nearer to the center than they have it.
  EXPECT_NEAR(OffsetFromCenter(refined).norm() / FoundOffset(refined), 0.96, 0.03);
  EXPECT_LT(OffsetFromCenter(centered).norm(), 0.985 * FoundOffset(centered));
}

// Whose photographs are whole: their principal points are near the centers, where COLMAP has them.
TEST(Reconstruct, PrincipalPointsOfCamerasWithExifAreAWarning) {
  Database database = MakeDatabaseOffCenter({14, -9}),
           hardly_off = MakeDatabaseOffCenter(kHardlyOff);
  for (Database* of : {&database, &hardly_off}) {
    for (Camera camera : of->ReadCameras()) {
      camera.has_prior_focal_length = true;
      of->WriteCamera(camera);
    }
  }
  EXPECT_THAT(Reconstruct(hardly_off).report.warnings, IsEmpty());
  const ReconstructResult stays = Reconstruct(database);
  ASSERT_TRUE(stays.report.Succeeded()) << stays.report.failure;
  EXPECT_EQ(OffsetFromCenter(stays), Eigen::Vector2d::Zero());
  ASSERT_EQ(stays.report.warnings.size(), 1u);
  EXPECT_THAT(stays.report.warnings[0].what, HasSubstr("image centers are kept"));
  EXPECT_THAT(stays.report.warnings[0].advice,
              HasSubstr("--reconstruct.refine_principal_points all"));

  ReconstructSettings all;
  all.reconstruct.refine_principal_points = PrincipalPointRefinement::kAll;
  EXPECT_LT((OffsetFromCenter(Reconstruct(database, all)) - Eigen::Vector2d(14, -9)).norm(), 6);
  database.DeleteImagesAndPairs({8, 9, 10, 11, 12, 13, 14});
  TestMonitor monitor;
  const ReconstructResult few =
      Reconstruct(database, "", all, {.num_threads = 1, .monitor = monitor});
  EXPECT_EQ(OffsetFromCenter(few), Eigen::Vector2d::Zero());
  EXPECT_THAT(monitor.notes(), Contains(HasSubstr("of 1 cameras stay at the image centers")));
}

// Of two cameras, one of which is off center: the one warning.
std::string WarningOfOneOffCenter(camera_t off_center, const std::set<camera_t>& with_exif) {
  SceneOptions options = SmallScene();
  options.num_images = 24;
  options.num_cameras = 2;
  SyntheticScene scene = MakeScene(options, 3);
  for (auto& [id, keypoints] : scene.keypoints) {
    if (scene.truth.images.at(id).image.camera_id != off_center) continue;
    for (Keypoint& keypoint : keypoints) keypoint.x += 30;
  }
  Database database = MakeDatabaseWithGuesses(scene, 1.02);
  for (Camera camera : database.ReadCameras()) {
    camera.has_prior_focal_length = with_exif.contains(camera.camera_id);
    database.WriteCamera(camera);
  }
  ReconstructSettings settings;
  settings.reconstruct.share_camera = false;
  const ReconstructResult result = Reconstruct(database, settings);
  EXPECT_EQ(result.report.warnings.size(), 1u) << result.report.failure;
  return result.report.warnings.empty() ? "" : result.report.warnings[0].what;
}

TEST(Reconstruct, CamerasWithoutExifBesideThemDoNotHideThatWarning) {
  EXPECT_THAT(WarningOfOneOffCenter(1, {1}), HasSubstr("camera 1: principal point"));
}

TEST(Reconstruct, ThatWarningNamesTheCameraThatIsFarthestOff) {
  EXPECT_THAT(WarningOfOneOffCenter(2, {1, 2}), HasSubstr("camera 2: principal point"));
}

// Photographs by one lens, of which the database has the focal length and no distortion.
struct LensScene {
  SyntheticScene scene;
  Database database;
};

LensScene MakeLensScene(CameraModel lens, double distortion) {
  SceneOptions options = SmallScene();
  options.num_images = 16;
  options.num_cameras = 1;
  options.camera_model = lens;
  options.radial_distortion = distortion;
  options.focal_length = 0.6;
  options.distance = 1.6;
  options.num_points = 2000;
  options.outlier_ratio = 0;
  SyntheticScene scene = MakeScene(options, 3);
  Database database = MakeDatabase(scene);
  Camera camera = Camera::FromFocal(1, CameraModel::kSimpleRadial, scene.cameras.at(1).MeanFocal(),
                                    options.image_width, options.image_height);
  database.WriteCamera(camera);
  return {std::move(scene), std::move(database)};
}

TEST(Reconstruct, GivesLensesThatBendMuchAModelOfTwoParameters) {
  const LensScene fisheye = MakeLensScene(CameraModel::kSimpleRadialFisheye, 0.02);
  const ReconstructResult chosen = Reconstruct(fisheye.database);
  ASSERT_TRUE(chosen.report.Succeeded()) << chosen.report.failure;
  const Reconstruction& model = chosen.models.front();
  EXPECT_EQ(model.cameras.at(1).model, CameraModel::kRadialFisheye);
  ExpectFocals(model, fisheye.scene, 1.0, 0.005);
  EXPECT_LT(CompareAligned(model, fisheye.scene.truth).angle, 0.002);
  const StageReport* stage = FindStage(chosen.report, "lens_models");
  ASSERT_NE(stage, nullptr);
  EXPECT_THAT(stage->messages, ElementsAre(HasSubstr("RADIAL_FISHEYE of ")));

  ReconstructSettings settings;
  settings.reconstruct.choose_lens_models = false;
  const ReconstructResult held = Reconstruct(fisheye.database, settings);
  ASSERT_TRUE(held.report.Succeeded()) << held.report.failure;
  EXPECT_EQ(held.models.front().cameras.at(1).model, CameraModel::kSimpleRadial);

  // One parameter tells all of this one.
  const LensScene bent = MakeLensScene(CameraModel::kSimpleRadial, -0.15);
  const ReconstructResult stays = Reconstruct(bent.database);
  ASSERT_TRUE(stays.report.Succeeded()) << stays.report.failure;
  EXPECT_EQ(stays.models.front().cameras.at(1).model, CameraModel::kSimpleRadial);
  EXPECT_LT(Value(*FindStage(stays.report, "lens_models"), "standard_errors_of_gain"), 1.645);
  EXPECT_LT(CompareAligned(stays.models.front(), bent.scene.truth).angle, 0.002);
}

// Near the border the second parameter takes back what the first one does, as with phones.
LensScene MakePhoneScene(double k1, double k2) {
  LensScene phone = MakeLensScene(CameraModel::kSimpleRadial, 0);
  const Camera& straight = phone.scene.cameras.at(1);
  Camera lens = straight;
  lens.model = CameraModel::kRadial;
  lens.params = {straight.MeanFocal(), straight.PrincipalPoint().x(), straight.PrincipalPoint().y(),
                 k1, k2};
  for (auto& [id, keypoints] : phone.scene.keypoints) {
    for (Keypoint& keypoint : keypoints) {
      const auto pixel = lens.ImgFromRay(*straight.RayFromImg(keypoint.Position()));
      keypoint.x = static_cast<float>(pixel->x());
      keypoint.y = static_cast<float>(pixel->y());
    }
  }
  phone.database = MakeDatabaseWithGuesses(phone.scene, 1.02);
  return phone;
}

TEST(Reconstruct, FindsBothParametersOfALensThatHardlyBends) {
  const LensScene phone = MakePhoneScene(0.06, -0.08);
  const ReconstructResult result = Reconstruct(phone.database);
  ASSERT_TRUE(result.report.Succeeded()) << result.report.failure;
  const Camera& found = result.models.front().cameras.at(1);
  ASSERT_EQ(found.model, CameraModel::kRadial);
  EXPECT_NEAR(found.params[3], 0.06, 0.006);
  EXPECT_NEAR(found.params[4], -0.08, 0.008);
  ExpectFocals(result.models.front(), phone.scene, 1.0, 0.002);
  EXPECT_LT(CompareAligned(result.models.front(), phone.scene.truth).angle, 0.001);
}

// A chance of 5 % decides; with EXIF, what is beyond doubt.
TEST(Reconstruct, LensesOfPhotographsWithExifNeedMoreEvidence) {
  for (const bool has_exif : {false, true}) {
    LensScene phone = MakePhoneScene(0.006, -0.008);
    for (Camera camera : phone.database.ReadCameras()) {
      camera.has_prior_focal_length = has_exif;
      phone.database.WriteCamera(camera);
    }
    const ReconstructResult result = Reconstruct(phone.database);
    ASSERT_TRUE(result.report.Succeeded()) << result.report.failure;
    EXPECT_EQ(result.models.front().cameras.at(1).model,
              has_exif ? CameraModel::kSimpleRadial : CameraModel::kRadial);
    const double errors =
        Value(*FindStage(result.report, "lens_models"), "standard_errors_of_gain");
    EXPECT_GT(errors, 1.645);
    EXPECT_LT(errors, 3);
  }
}

}  // namespace
}  // namespace cairn
