#include <map>
#include <set>

#include "mapper/stages.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {
namespace {

TEST(Reconstruct, RefinesUnknownFocalLengths) {
  SyntheticScene scene = MakeScene(SmallScene(), 3);
  const Database database = MakeDatabaseWithGuesses(scene, 1.04);
  const ReconstructResult refined = Reconstruct(database);
  ASSERT_TRUE(refined.report.Succeeded()) << refined.report.failure;
  ExpectFocals(refined.models.front(), scene, 1.0, 0.01);
  ReconstructSettings held;
  held.refine_intrinsics = false;
  const ReconstructResult fixed = Reconstruct(database, held);
  ASSERT_TRUE(fixed.report.Succeeded());
  ExpectFocals(fixed.models.front(), scene, 1.04, 1e-9);
}

TEST(Reconstruct, FocalLengthsStayNearAGuessThatIsSure) {
  const SyntheticScene scene = MakeScene(SmallScene(), 3);
  const Database database = MakeDatabaseWithGuesses(scene, 1.04);
  ReconstructSettings settings;
  settings.focal_calibration.enabled = false;
  settings.focal_calibration.guess_sigma = 1e-3;
  const ReconstructResult result = Reconstruct(database, settings);
  ASSERT_TRUE(result.report.Succeeded()) << result.report.failure;
  ExpectFocals(result.models.front(), scene, 1.04, 0.02);
}

// Wide-angle cameras of which nothing is known but a guess far off.
TEST(Reconstruct, CalibratesFocalLengthsFromThePairs) {
  const SyntheticScene scene = MakeScene(SmallScene(), 3);
  const Database database = MakeDatabaseWithGuesses(scene, 1.7);
  const ReconstructResult result = Reconstruct(database);
  ASSERT_TRUE(result.report.Succeeded()) << result.report.failure;
  EXPECT_EQ(result.models.front().images.size(), 10u);
  ExpectFocals(result.models.front(), scene, 1.0, 0.01);
  const StageReport* stage = FindStage(result.report, "focal_calibration");
  ASSERT_NE(stage, nullptr);
  EXPECT_EQ(stage->status, StageStatus::kOk);
  EXPECT_EQ(Value(*stage, "calibrated"), 2);
  EXPECT_THAT(stage->messages, ElementsAre(HasSubstr("camera 1: focal length "),
                                           HasSubstr("camera 2: focal length ")));

  ReconstructSettings settings;
  settings.focal_calibration.enabled = false;
  EXPECT_EQ(FindStage(Reconstruct(database, settings).report, "focal_calibration"), nullptr);
}

// Loops that close neither better nor worse leave the pairs' focal lengths.
TEST(Reconstruct, LoopsThatDoNotDecideRejectNothing) {
  SceneOptions options = SmallScene();
  options.image_noise_px = 2.0;
  const SyntheticScene scene = MakeScene(options, 3);
  const Database database = MakeDatabaseWithGuesses(scene, 1.3);
  ReconstructSettings settings;
  settings.focal_calibration.max_sigma = 0.3;
  const RunReport report = Reconstruct(database, settings).report;
  const StageReport* stage = FindStage(report, "focal_calibration");
  ASSERT_NE(stage, nullptr);
  EXPECT_EQ(Value(*stage, "calibrated"), 2);
  EXPECT_EQ(Value(*stage, "rejected_by_loops"), 0);
}

// Stored poses of pairs with fundamental matrices: verification tried other focal lengths for them,
// so that they do not speak for the guess.
TEST(Reconstruct, PosesOfUncalibratedPairsDoNotSpeakForTheGuess) {
  SceneOptions options = SmallScene();
  options.image_noise_px = 0.8;
  options.pair_metrics = true;  // verified by us, so that the stored poses count
  const SyntheticScene scene = MakeScene(options, 3);
  Database database = MakeDatabaseWithGuesses(scene, 2.0);
  ChangeGeometries(database, [](image_t, image_t, TwoViewGeometry& geometry) {
    geometry.config = TwoViewConfig::kUncalibrated;
    geometry.E.reset();
  });
  ReconstructSettings settings;
  settings.focal_calibration.max_sigma = 0.3;
  const RunReport report = Reconstruct(database, settings).report;
  const StageReport* stage = FindStage(report, "focal_calibration");
  ASSERT_NE(stage, nullptr);
  EXPECT_EQ(Value(*stage, "calibrated"), 2);
  EXPECT_EQ(Value(*stage, "rejected_by_loops"), 0);
}

// Verification has found the focal length to be wrong: it is no more than a guess.
TEST(Reconstruct, RejectedFocalLengthsAreGuesses) {
  const SyntheticScene scene = MakeScene(SmallScene(), 3);
  Database database = MakeDatabase(scene);
  for (auto [id, camera] : scene.cameras) {
    camera.has_prior_focal_length = true;
    if (id == 1) camera.SetMeanFocal(2.5 * camera.MeanFocal());
    database.WriteCamera(camera);
  }
  database.WriteCameraFocals({{1, {true, 5, 4}}});
  const ReconstructResult result = Reconstruct(database);
  ASSERT_TRUE(result.report.Succeeded()) << result.report.failure;
  const StageReport* stage = FindStage(result.report, "focal_calibration");
  EXPECT_THAT(stage->messages, ElementsAre(HasSubstr("(guessed)"), HasSubstr("(EXIF)")));
  ExpectFocals(result.models.front(), scene, 1.0, 0.01);
}

// Its two cameras look measured.
Database MakeMeasuredDatabase(bool has_prior) {
  SceneOptions options = SmallScene();
  options.camera_model = CameraModel::kPinhole;
  const SyntheticScene scene = MakeScene(options, 3);
  Database database = MakeDatabase(scene);
  for (auto [id, camera] : scene.cameras) {
    camera.params[1] *= 1.001;  // fy
    camera.has_prior_focal_length = has_prior;
    database.WriteCamera(camera);
  }
  return database;
}

// A camera that looks measured is constant, but not at a focal length that its pairs contradict.
TEST(Reconstruct, RejectedFocalLengthsAreNotConstantUnlessTheUserWantsIt) {
  Database database = MakeMeasuredDatabase(true);
  database.WriteCameraFocals({{1, {true, 5, 4}}});
  const RunReport report = Reconstruct(database).report;
  EXPECT_EQ(Value(*FindStage(report, "read"), "cameras_constant"), 1);
  EXPECT_EQ(FindStage(report, "read")->status, StageStatus::kOk);
  ReconstructSettings settings;
  settings.refine_intrinsics = false;
  const RunReport held = Reconstruct(database, settings).report;
  EXPECT_EQ(Value(*FindStage(held, "read"), "cameras_constant"), 2);
  EXPECT_THAT(FindStage(held, "read")->messages,
              Contains(HasSubstr("camera 1 are constant, but 4 of 5 pairs contradict")));
}

TEST(Reconstruct, MeasuredCamerasWithoutAPriorAreAWarning) {
  Database database = MakeMeasuredDatabase(false);
  const auto texts = [&](const ReconstructSettings& settings) {
    std::string all;
    for (const ResultWarning& warning : Reconstruct(database, settings).report.warnings) {
      all += warning.what + "\n";
    }
    return all;
  };
  EXPECT_THAT(texts({}), HasSubstr("2 cameras look measured"));
  ReconstructSettings settings;
  settings.refine_intrinsics = true;
  EXPECT_THAT(texts(settings), Not(HasSubstr("look measured")));
}

TEST(Reconstruct, GuessesThatAreConstantAreAWarning) {
  ReconstructSettings settings;
  settings.refine_intrinsics = false;
  for (const bool has_exif : {false, true}) {
    Database database = MakeDatabaseWithGuesses(MakeScene(SmallScene(), 3), 1.0);
    for (Camera camera : database.ReadCameras()) {
      camera.has_prior_focal_length = has_exif;
      database.WriteCamera(camera);
    }
    const RunReport report = Reconstruct(database, settings).report;
    const StageReport* read = FindStage(report, "read");
    EXPECT_EQ(read->status, has_exif ? StageStatus::kOk : StageStatus::kWarning);
  }
}

TEST(Reconstruct, OverrulesExifThatIsFarOff) {
  const SyntheticScene scene = MakeScene(SmallScene(), 3);
  Database database = MakeDatabase(scene);
  for (auto [id, camera] : scene.cameras) {
    camera.SetMeanFocal((id == 1 ? 1.5 : 1.02) * camera.MeanFocal());
    camera.has_prior_focal_length = true;
    database.WriteCamera(camera);
  }
  const ReconstructResult result = Reconstruct(database);
  ASSERT_TRUE(result.report.Succeeded()) << result.report.failure;
  const StageReport* stage = FindStage(result.report, "focal_calibration");
  EXPECT_EQ(stage->status, StageStatus::kWarning);
  EXPECT_THAT(stage->messages, ElementsAre(HasSubstr("calibrated; EXIF's focal length is rejected"),
                                           HasSubstr("confirmed")));
  ExpectFocals(result.models.front(), scene, 1.0, 0.01);
}

// Images' only camera with this focal length, by EXIF.
Database MakeDatabaseWithExif(SyntheticScene scene, double factor) {
  for (auto& [id, camera] : scene.cameras) {
    camera.SetMeanFocal(factor * camera.MeanFocal());
    camera.has_prior_focal_length = true;
  }
  return MakeDatabase(scene);
}

// The stored poses close loops better than those of noisy matches, and yet EXIF is wrong.
TEST(Reconstruct, LoopsAloneDoNotDecideBetweenPairsAndExif) {
  SceneOptions options = SmallScene();
  options.image_noise_px = 1.2;
  options.pair_metrics = true;  // verified by us, so that the stored poses count
  const SyntheticScene scene = MakeScene(options, 3);
  ReconstructSettings settings;
  settings.focal_calibration.max_sigma = 0.3;
  const ReconstructResult result = Reconstruct(MakeDatabaseWithExif(scene, 2.0), settings);
  const StageReport* stage = FindStage(result.report, "focal_calibration");
  ASSERT_NE(stage, nullptr);
  EXPECT_EQ(Value(*stage, "rejected_by_loops"), 0);
  ASSERT_EQ(result.models.size(), 1u);
  ExpectFocals(result.models.front(), scene, 1.0, 0.05);
}

// Along a front, hardly anything tells the focal length; what a camera model leaves out, here
// distortion that grows with the sixth power of the radius, must not. (Free, the focal length ends
// at seven tenths.)
TEST(Reconstruct, LensErrorsDoNotOverruleExif) {
  SceneOptions options;
  options.layout = CameraLayout::kStreet;
  options.num_images = 16;
  options.num_points = 1500;
  options.num_cameras = 1;
  options.image_noise_px = 0.5;
  options.camera_model = CameraModel::kSimpleRadial;
  SyntheticScene scene = MakeScene(options, 1);
  const Eigen::Vector2d center = scene.cameras.at(1).PrincipalPoint();
  for (auto& [id, keypoints] : scene.keypoints) {
    for (Keypoint& keypoint : keypoints) {
      const Eigen::Vector2d offset = keypoint.Position() - center;
      const Eigen::Vector2d pixel = center + (1 - 0.5 * std::pow(offset.norm() / 1000, 6)) * offset;
      keypoint.x = static_cast<float>(pixel.x());
      keypoint.y = static_cast<float>(pixel.y());
    }
  }
  const ReconstructResult result = Reconstruct(MakeDatabaseWithExif(scene, 1.0));
  ASSERT_EQ(result.models.size(), 1u);
  EXPECT_EQ(result.models.front().images.size(), 16u);
  ExpectFocals(result.models.front(), scene, 1.0, 0.2);
}

// The pairs are not sure enough, but the model is.
TEST(Reconstruct, EvidenceOverrulesExif) {
  const SyntheticScene scene = MakeScene(SmallScene(), 3);
  ReconstructSettings settings;
  settings.focal_calibration.exif_sigma = 0.01;
  const ReconstructResult result = Reconstruct(MakeDatabaseWithExif(scene, 1.15), settings);
  const StageReport* choice = FindStage(result.report, "calibration_choice");
  ASSERT_NE(choice, nullptr);
  EXPECT_THAT(choice->messages, Contains(HasSubstr("focal lengths held at EXIF's")));
  ASSERT_EQ(result.models.size(), 1u);
  ExpectFocals(result.models.front(), scene, 1.0, 0.01);
}

// Photographs of many cameras, cropped: EXIF's focal lengths are wrong by up to a half, pairs are
// not sure of others, and have poses by these.
TEST(Reconstruct, PairsGetPosesByTheFocalLengthsOfModels) {
  SceneOptions options = SmallScene();
  options.num_images = options.num_cameras = 16;
  options.num_points = 200;
  options.pair_outlier_ratio = 0.3;
  options.image_noise_px = 2;
  SyntheticScene scene = MakeScene(options, 4);
  const Reconstruction truth = scene.truth;
  Rng rng(1);
  for (auto& [id, camera] : scene.cameras) {
    camera.SetMeanFocal(std::exp(rng.Uniform(-0.4, 0.4)) * camera.MeanFocal());
    camera.has_prior_focal_length = true;
  }
  const ReconstructResult result = Reconstruct(MakeDatabase(scene));
  const StageReport* choice = FindStage(result.report, "calibration_choice");
  ASSERT_NE(choice, nullptr);
  EXPECT_EQ(choice->messages.back(),
            "the models are those with the intrinsics of the best models before");
  EXPECT_GT(Value(*choice, "evidence_nats"), 1.02 * std::stod(choice->messages.front()));
  ASSERT_EQ(result.models.size(), 1u);
  EXPECT_EQ(result.models[0].images.size(), 16u);
  EXPECT_LT(RadToDeg(CompareAligned(result.models[0], truth).angle), 1);
}

}  // namespace
}  // namespace cairn
