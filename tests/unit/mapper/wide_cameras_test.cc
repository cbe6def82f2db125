// Lenses that see 180 degrees and more, through verification and reconstruction.

#include "cairn/pipeline/verify_pairs.h"
#include "intrinsics/known_intrinsics.h"
#include "intrinsics/wide_focals.h"
#include "support/check_consistency.h"
#include "support/database_dump.h"
#include "support/synthetic_reconstruction.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "unit/mapper/reconstruct_fixture.h"
#include "unit/mapper/wide_scene.h"

namespace cairn {
namespace {

constexpr int kSize = 1200;

Camera MakeCamera(CameraModel model, std::vector<double> params) {
  Camera camera = Camera::FromFocal(1, model, 400, kSize, kSize);
  camera.params = std::move(params);
  camera.has_prior_focal_length = true;
  return camera;
}

StageReport Verify(Database& database) {
  VerificationInput input;
  input.options = "a = 1\n";
  return VerifyPairs(database, MakeVerifiers("cascade", {}), input, {.num_threads = 2});
}

// Returns the model; without images where there is none.
Reconstruction ExpectNearTruth(const Database& database, const Reconstruction& truth,
                               double max_angle, double max_center) {
  const ReconstructResult result = Reconstruct(database);
  EXPECT_TRUE(result.report.Succeeded()) << result.report.failure;
  EXPECT_EQ(result.models.size(), 1u);
  if (result.models.empty()) return {};
  const Reconstruction& model = result.models.front();
  CheckConsistency(model);
  EXPECT_EQ(model.images.size(), truth.images.size());
  const auto difference = CompareAligned(model, truth);
  EXPECT_LT(difference.angle, max_angle);
  EXPECT_LT(difference.center, max_center);
  EXPECT_LT(model.MeanReprojectionErrorPx(), 0.8);
  // Points all around: also beside and behind the cameras where the lens sees that far.
  int num_wide = 0;
  for (const auto& [id, point] : model.points3D) {
    for (const TrackElement& element : point.track) {
      const RegisteredImage& image = model.images.at(element.image_id);
      num_wide += (image.cam_from_world * point.xyz).normalized().z() < 0.34;  // 70 degrees
    }
  }
  EXPECT_GT(num_wide, 100);
  return model;
}

class WideCamerasTest : public ::testing::Test {
 protected:
  TempFolder folder_;
  Database database_{folder_ / "scene.db"};
};

struct KnownCase {
  CameraModel model;
  std::vector<double> params;
  double field_deg;
};

class KnownWideCamerasTest : public WideCamerasTest,
                             public ::testing::WithParamInterface<KnownCase> {};

TEST_P(KnownWideCamerasTest, GiveTheTruePoses) {
  const KnownCase& c = GetParam();
  const Camera camera = MakeCamera(c.model, c.params);
  const Reconstruction truth =
      WriteWideScene(camera, camera, {.field_deg = c.field_deg}, 1, database_);
  const StageReport report = Verify(database_);
  EXPECT_EQ(report.Value("rejected_focals"), 0);
  int num_poses = 0;
  for (const auto& [pair_id, num_matches] : database_.ReadNumMatches()) {
    const auto geometry = database_.ReadTwoViewGeometry(pair_id);
    if (!geometry || !geometry->cam2_from_cam1) continue;
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    const Rigid3d expected =
        truth.images.at(id2).cam_from_world * Inverse(truth.images.at(id1).cam_from_world);
    // Small overlaps at the rim of both images fix a pose less well.
    const double tolerance = num_matches > 150 ? 0.01 : 0.08;
    EXPECT_LT(AngleBetween(geometry->cam2_from_cam1->rotation, expected.rotation), tolerance);
    EXPECT_LT((geometry->cam2_from_cam1->translation - expected.translation.normalized()).norm(),
              5 * tolerance);
    // The noise is 0.5 px in each image: nearly all right matches are inliers, however far off
    // axis.
    EXPECT_GT(geometry->inlier_matches.size(), 0.7 * num_matches);
    EXPECT_FALSE(geometry->F.has_value());
    ++num_poses;
  }
  EXPECT_GT(num_poses, 35);
  ExpectNearTruth(database_, truth, 2e-3, 0.01);
}

INSTANTIATE_TEST_SUITE_P(
    Models, KnownWideCamerasTest,
    ::testing::Values(KnownCase{CameraModel::kOpenCVFisheye,
                                {380, 384, 603, 597, -0.02, 0.003, -0.001, 0.0001},
                                180},
                      KnownCase{CameraModel::kSimpleFisheye, {310, 600, 600}, 220},
                      KnownCase{CameraModel::kEucm, {300, 300, 600, 600, 0.6, 1.1}, 180},
                      KnownCase{CameraModel::kFov, {420, 420, 600, 600, 0.9}, 150},
                      KnownCase{CameraModel::kEquirectangular, {kSize, kSize}, 300}),
    [](const auto& info) { return std::string(CameraModelName(info.param.model)); });

TEST_F(WideCamerasTest, UnknownFocalLengthsAreFound) {
  // Nearly an equisolid lens: 2 sin(theta / 2) = theta (1 - theta^2 / 24 + ...).
  const Camera camera = MakeCamera(CameraModel::kSimpleRadialFisheye, {400, 600, 600, -0.04});
  for (const double guess : {280.0, 600.0}) {
    Database database(folder_ / std::to_string(guess));
    Camera guessed = Camera::FromFocal(1, camera.model, guess, kSize, kSize);
    const Reconstruction truth = WriteWideScene(camera, guessed, {.field_deg = 150}, 2, database);
    const std::vector<std::string> texts = LearnWideFocals(database, {}, {.num_threads = 2});
    ASSERT_EQ(texts.size(), 1u);
    EXPECT_THAT(texts[0], HasSubstr("camera 1: focal length"));
    const Camera found = ReadKnownIntrinsics(database).begin()->second.camera;
    // The coefficient is still unknown: between the scale at the center, 400 px a radian, and that
    // at the rim, 400 (1 - 3 * 0.04 * 1.31^2), where most matches are.
    EXPECT_GT(found.MeanFocal(), 300) << guess;
    EXPECT_LT(found.MeanFocal(), 410) << guess;
    EXPECT_FALSE(found.has_prior_focal_length);
    EXPECT_TRUE(LearnWideFocals(database, {}, {.num_threads = 2}).empty());
    // The camera's row stays as it was given, so that a search anew begins where this one did.
    EXPECT_EQ(database.ReadCameras().at(0).params, guessed.params);
    database.ClearStage("verification");
    EXPECT_EQ(LearnWideFocals(database, {}, {.num_threads = 2}), texts);
    Verify(database);
    const std::vector<image_pair_t> verified = database.ReadTwoViewGeometryPairIds();
    ASSERT_GE(verified.size(), truth.images.size());
    for (const image_pair_t pair_id : verified) {
      EXPECT_NE(database.ReadTwoViewGeometry(pair_id)->config, TwoViewConfig::kCalibrated);
    }
    const Reconstruction model = ExpectNearTruth(database, truth, 5e-3, 0.02);
    ASSERT_EQ(model.cameras.size(), 1u);
    EXPECT_NEAR(model.cameras.at(1).params[0], 400, 3);
    EXPECT_NEAR(model.cameras.at(1).params[3], -0.04, 0.005);
  }
}

// Photographs without EXIF have a camera each.
TEST_F(WideCamerasTest, CamerasOfOneKindAreAskedTogether) {
  const Camera camera = MakeCamera(CameraModel::kSimpleRadialFisheye, {400, 600, 600, -0.04});
  Camera guessed = Camera::FromFocal(1, camera.model, 600, kSize, kSize);
  WriteWideScene(camera, guessed, {.field_deg = 150}, 2, database_);
  const std::vector<std::string> of_one = LearnWideFocals(database_, {}, {.num_threads = 2});
  database_.ClearStage("verification");
  for (Image image : database_.ReadImages()) {
    guessed.camera_id = image.camera_id = 100 + image.image_id;
    database_.WriteCamera(guessed);
    database_.WriteImage(image);
  }
  const std::vector<std::string> texts = LearnWideFocals(database_, {}, {.num_threads = 2});
  ASSERT_EQ(texts.size(), 2u);  // Camera 1 has no photograph now.
  EXPECT_THAT(texts[1], HasSubstr("camera 101 and 9 of its kind: focal length"));
  EXPECT_THAT(of_one, ElementsAre(HasSubstr(texts[1].substr(texts[1].find(':')))));
  for (const Image& image : database_.ReadImages()) {
    EXPECT_LT(ReadKnownIntrinsics(database_).at(image.camera_id).camera.MeanFocal(), 410);
  }
}

// Pairs with too few matches determine nothing; others may come later.
TEST_F(WideCamerasTest, FocalLengthsThatWereNotFoundAreLookedForAgain) {
  const Camera camera = MakeCamera(CameraModel::kSimpleRadialFisheye, {400, 600, 600, -0.04});
  WriteWideScene(camera, Camera::FromFocal(1, camera.model, 600, kSize, kSize), {.field_deg = 150},
                 2, database_);
  const auto learn = [&](int min_num_matches) {
    return LearnWideFocals(database_, {.min_num_matches = min_num_matches}, {.num_threads = 2});
  };
  EXPECT_THAT(learn(100000), ElementsAre(HasSubstr("no pair determines the focal length")));
  EXPECT_THAT(learn(100000), IsEmpty());
  Verify(database_);  // with the guess
  EXPECT_THAT(learn(15), ElementsAre(HasSubstr("camera 1: focal length ")));
  EXPECT_THAT(database_.ReadTwoViewGeometryPairIds(), IsEmpty());
  EXPECT_THAT(learn(15), IsEmpty());
}

TEST_F(WideCamerasTest, CamerasThatAreKnownOrPlanarAreNotAsked) {
  const Camera known = MakeCamera(CameraModel::kSimpleFisheye, {380, 600, 600});
  WriteWideScene(known, known, {.num_images = 3, .num_points = 200}, 3, database_);
  Camera planar = Camera::FromFocal(2, CameraModel::kSimpleRadial, 900, kSize, kSize);
  database_.WriteCamera(planar);
  EXPECT_TRUE(LearnWideFocals(database_, {}, {.num_threads = 1}).empty());
  EXPECT_EQ(database_.ReadCameras()[0].params, known.params);
}

// Scripts that write calibrated cameras seldom say that their focal lengths are known.
TEST_F(WideCamerasTest, MeasuredCamerasStayAsTheyAre) {
  Camera measured = MakeCamera(CameraModel::kOpenCVFisheye, {380, 384, 603, 597, -0.02, 0, 0, 0});
  measured.has_prior_focal_length = false;
  WriteWideScene(measured, measured, {.field_deg = 150}, 2, database_);
  EXPECT_THAT(LearnWideFocals(database_, {}, {.num_threads = 2}), IsEmpty());
  EXPECT_TRUE(ReadKnownIntrinsics(database_).at(1).IsConstant());
}

TEST_F(WideCamerasTest, ACameraOfAnUnknownModelExcludesItsImagesOnly) {
  const Camera camera = MakeCamera(CameraModel::kSimpleFisheye, {380, 600, 600});
  const Reconstruction truth = WriteWideScene(camera, camera, {}, 4, database_);
  Camera other = camera;
  other.camera_id = 2;
  database_.WriteCamera(other);
  database_.WriteImage({3, "image3.png", 2});
  RunSql(database_.path(), "UPDATE cameras SET model = 99 WHERE camera_id = 2");
  ASSERT_EQ(database_.ReadCameras().size(), 1u);
  ASSERT_EQ(database_.ReadUnknownCameras().size(), 1u);
  EXPECT_EQ(database_.ReadUnknownCameras()[0].model_id, 99);
  EXPECT_EQ(database_.ReadUnknownCameras()[0].width, kSize);
  const StageReport report = Verify(database_);
  EXPECT_THAT(report.messages,
              Contains(AllOf(HasSubstr("image3.png"), HasSubstr("unknown model 99"))));
  const ReconstructResult result = Reconstruct(database_);
  ASSERT_TRUE(result.report.Succeeded()) << result.report.failure;
  EXPECT_EQ(result.models.at(0).images.size(), truth.images.size() - 1);
  const StageReport* read = FindStage(result.report, "read");
  ASSERT_NE(read, nullptr);
  EXPECT_THAT(read->messages,
              Contains(AllOf(HasSubstr("image3.png: left out"), HasSubstr("unknown model 99"))));
}

}  // namespace
}  // namespace cairn
