// Cameras that turn out to be fisheyes.
#include "pipeline/stages/fisheye_lenses.h"

#include "cairn/pipeline/verify_pairs.h"
#include "intrinsics/wide_focals.h"
#include "support/test.h"
#include "unit/mapper/wide_scene.h"

namespace cairn {
namespace {

constexpr CameraModel kFisheye = CameraModel::kSimpleRadialFisheye;

StageReport Verify(Database& database) {
  VerificationInput input;
  input.options = "a = 1\n";
  return VerifyPairs(database, MakeVerifiers("fast", {}), input, {.num_threads = 2});
}

CameraModel ModelOf(const Database& database) { return database.ReadCameras().front().model; }

// Photographs of 180 degrees, as our import leaves them where EXIF says nothing.
TEST(FisheyeLenses, AreTakenWherePairsShowMoreDistortionThanTheModelCanHave) {
  const Camera truth = Camera::FromFocal(1, kFisheye, 160, 480, 480);
  const Camera guess = Camera::FromFocal(1, CameraModel::kSimpleRadial, 576, 480, 480);
  TempFolder folder;
  Database database(folder / "a.db");
  WriteWideScene(truth, guess, {.num_images = 20, .num_points = 1500, .noise_px = 0.3}, 1,
                 database);
  Verify(database);
  EXPECT_EQ(TakeFisheyes(database, {}, {.num_threads = 2}).Value("cameras"),
            0);  // of another program's database
  for (const Image& image : database.ReadImages()) database.WritePhoto({image.name, 0, ""});
  const StageReport report = TakeFisheyes(database, {}, {.num_threads = 2});
  EXPECT_EQ(report.Value("cameras"), 1);
  EXPECT_EQ(report.warnings.size(), 1u);
  EXPECT_EQ(ModelOf(database), kFisheye);
  EXPECT_TRUE(database.ReadTwoViewGeometryPairIds().empty());
  LearnWideFocals(database, {}, {.num_threads = 2});
  EXPECT_GT(Verify(database).Value("verified"), 20);
  EXPECT_NEAR(database.ReadCameraLenses().at(1).focal_px / truth.MeanFocal(), 1, 0.1);
  EXPECT_EQ(TakeFisheyes(database, {}, {.num_threads = 2}).Value("cameras"), 0);
}

// A room by this camera, which the database knows as SIMPLE_RADIAL with this lens.
bool AreTaken(const Camera& truth, const CameraLens& lens, bool has_prior = false) {
  Camera camera = Camera::FromFocal(1, CameraModel::kSimpleRadial, 576, 480, 480);
  camera.has_prior_focal_length = has_prior;
  Database database(":memory:");
  WriteWideScene(truth, camera, {.num_images = 20, .num_points = 1500, .noise_px = 0.3}, 1,
                 database);
  for (const Image& image : database.ReadImages()) database.WritePhoto({image.name, 0, ""});
  database.WriteCameraLens(1, lens);
  TakeFisheyes(database, {}, {.num_threads = 2});
  return ModelOf(database) == kFisheye;
}

TEST(FisheyeLenses, AreNotTakenWhereTheModelMayHold) {
  const Camera truth = Camera::FromFocal(1, kFisheye, 160, 480, 480);
  // (The square of half the diagonal is 0.347 squared focal lengths: the corners fold at -0.427.)
  EXPECT_TRUE(AreTaken(truth, {.k = -0.5, .k_sigma = 0.02}));
  EXPECT_FALSE(AreTaken(truth, {.k = -0.5, .k_sigma = 0.03}));
  EXPECT_FALSE(AreTaken(truth, {.k = -0.4, .k_sigma = 0.001}));
  EXPECT_FALSE(AreTaken(truth, {.k = -0.5, .k_sigma = 0.02}, true));
  EXPECT_FALSE(AreTaken(truth, {}));
}

// A webcam of 120 degrees, whose distortion grows with the fifth power of the radius.
TEST(FisheyeLenses, AreNotTakenWherePairsHaveMoreSupportWithout) {
  Camera webcam = Camera::FromFocal(1, CameraModel::kRadial, 180, 480, 480);
  webcam.params[3] = -0.004;
  webcam.params[4] = -0.0115;
  EXPECT_FALSE(AreTaken(webcam, {.focal_px = 176, .k = -0.0435, .k_sigma = 0.0004}));
}

TEST(FisheyeLenses, AreThoseOfPhotographsOfTheirSizeThatJoinLater) {
  Database database(":memory:");
  for (camera_t id = 1; id <= 3; ++id) {
    const int height = id == 2 ? 500 : 400;
    const CameraModel model = id == 3 ? kFisheye : CameraModel::kSimpleRadial;
    database.WriteCamera(Camera::FromFocal(id, model, 600, 500, height));
    const std::string name = std::to_string(id) + ".jpg";
    database.WriteImage({id, name, id});
    database.WritePhoto({name, 0, ""});
  }
  EXPECT_EQ(TakeFisheyes(database, {}, {.num_threads = 2}).Value("cameras"), 1);
  EXPECT_EQ(ModelOf(database), kFisheye);
}

}  // namespace
}  // namespace cairn
