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
  EXPECT_EQ(TakeFisheyes(database, {}).Value("cameras"), 0);  // of another program's database
  for (const Image& image : database.ReadImages()) database.WritePhoto({image.name, 0, ""});
  const StageReport report = TakeFisheyes(database, {});
  EXPECT_EQ(report.Value("cameras"), 1);
  EXPECT_EQ(report.warnings.size(), 1u);
  EXPECT_EQ(ModelOf(database), kFisheye);
  EXPECT_TRUE(database.ReadTwoViewGeometryPairIds().empty());
  LearnWideFocals(database, {}, {.num_threads = 2});
  EXPECT_GT(Verify(database).Value("verified"), 20);
  EXPECT_NEAR(database.ReadCameraLenses().at(1).focal_px / truth.MeanFocal(), 1, 0.1);
  EXPECT_EQ(TakeFisheyes(database, {}).Value("cameras"), 0);
}

TEST(FisheyeLenses, AreNotTakenWhereTheModelMayHold) {
  Database database(":memory:");
  database.WriteCamera(Camera::FromFocal(1, CameraModel::kSimpleRadial, 600, 500, 500));
  database.WriteImage({1, "a.jpg", 1});
  database.WritePhoto({"a.jpg", 0, ""});
  const auto is_taken = [&](const CameraLens& lens, bool has_prior) {
    Camera camera = Camera::FromFocal(1, CameraModel::kSimpleRadial, 600, 500, 500);
    camera.has_prior_focal_length = has_prior;
    database.WriteCamera(camera);
    database.WriteCameraLens(1, lens);
    TakeFisheyes(database, {});
    return ModelOf(database) == kFisheye;
  };
  // (The square of half the diagonal is 0.347 squared focal lengths: the corners fold at -0.427.)
  EXPECT_TRUE(is_taken({.k = -0.5, .k_sigma = 0.02}, false));
  EXPECT_FALSE(is_taken({.k = -0.5, .k_sigma = 0.03}, false));
  EXPECT_FALSE(is_taken({.k = -0.4, .k_sigma = 0.001}, false));
  EXPECT_FALSE(is_taken({.k = -0.5, .k_sigma = 0.02}, true));
  EXPECT_FALSE(is_taken({}, false));
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
  EXPECT_EQ(TakeFisheyes(database, {}).Value("cameras"), 1);
  EXPECT_EQ(ModelOf(database), kFisheye);
}

}  // namespace
}  // namespace cairn
