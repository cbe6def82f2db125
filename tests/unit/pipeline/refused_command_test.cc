// Commands that cannot be carried out, or that leave something out which earlier ones had.

#include <filesystem>
#include <functional>
#include <stdexcept>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/pipeline/build_pipeline.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "support/thrown_message.h"
#include "unit/pipeline/wall_fixture.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;
using ::testing::Each;

class RefusedCommandTest : public WallTest {
 protected:
  RefusedCommandTest() : WallTest(4, 8) {}
};

TEST_F(RefusedCommandTest, AListOfPairsIsNotLeftOutWithoutAWord) {
  const auto warnings = [](BuildPipelineOptions options) {
    options.inputs.depth_path = "";
    TestMonitor monitor;
    RunBuildPipeline(options, {.monitor = monitor});
    return monitor.warnings();
  };
  WriteFileAtomically(folder_ / "pairs.txt", "photo0.png photo1.png\n");
  BuildPipelineOptions listed = Options("a.db");
  listed.inputs.pairs_path = folder_ / "pairs.txt";
  EXPECT_THAT(warnings(listed), IsEmpty());
  EXPECT_THAT(warnings(listed), IsEmpty());
  EXPECT_THAT(warnings(Options("a.db")), ElementsAre(HasSubstr("earlier runs took the pairs of")));
  EXPECT_THAT(warnings(Options("a.db")), IsEmpty());
  EXPECT_THAT(warnings(listed), ElementsAre(HasSubstr("pairs that earlier runs chose stay")));
  // A way that the database remembers is not one that is given.
  BuildPipelineOptions sequential = Options("b.db");
  sequential.inputs.pairs = "sequential";
  RunBuildPipeline(sequential);
  EXPECT_THAT(StoredOptions(sequential.inputs), Contains(HasSubstr("pairs = \"sequential\"")));
  sequential.inputs.pairs_path = listed.inputs.pairs_path;
  EXPECT_THAT(StoredOptions(sequential.inputs), Each(Not(HasSubstr("pairs = "))));
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(sequential); }),
              HasSubstr("--pairs cannot be given too"));
}

TEST_F(RefusedCommandTest, MasksAndDepthAreNotLeftOutWithoutAWord) {
  fs::create_directories(folder_ / "masks");
  WriteBitmap(folder_ / "masks/photo0.png.png", WallPhoto(160, 120, 0));
  BuildPipelineOptions options = Options("a.db");
  options.inputs.mask_path = folder_ / "masks";
  options.inputs.stop_after = BuildStage::kDepth;
  RunBuildPipeline(options);
  options.inputs.mask_path = options.inputs.depth_path = "";
  const auto warnings_of_run = [&options] {
    TestMonitor monitor;
    RunBuildPipeline(options, {.monitor = monitor});
    return monitor.warnings();
  };
  EXPECT_THAT(warnings_of_run(), IsEmpty());  // nothing is new
  AddPhoto(4);
  EXPECT_THAT(warnings_of_run(), ElementsAre(HasSubstr("--mask_path"), HasSubstr("--depth_path")));
  options.inputs.recompute = BuildStage::kFeatures;  // all is found anew
  EXPECT_THAT(warnings_of_run(), ElementsAre(HasSubstr("--mask_path"), HasSubstr("--depth_path")));
}

TEST_F(RefusedCommandTest, MasksThatDoNotFitAreNamedBeforeAnyWork) {
  const std::string mask = folder_ / "masks/photo3.png.png";
  fs::create_directories(folder_ / "masks");
  BuildPipelineOptions options = Options("a.db");
  options.inputs.mask_path = folder_ / "masks";
  const auto message = [&options]() -> std::string {
    const std::string error = ThrownMessage<std::runtime_error>([&] { RunBuildPipeline(options); });
    EXPECT_TRUE(Database(options.inputs.database_path).ReadImages().empty());
    return error;
  };
  EXPECT_THAT(message(), HasSubstr("no mask of any image"));
  WriteBitmap(mask, Bitmap{20, 10, 1, std::vector<uint8_t>(200)});
  EXPECT_THAT(message(), HasSubstr("photo3.png.png is 20 x 10 pixels, its photograph 160 x 120"));
  WriteFileAtomically(mask, "broken");
  EXPECT_THAT(message(), HasSubstr("photo3.png.png"));
  options.inputs.image_path = "";
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("mask_path: needs --image_path"));
}

TEST_F(RefusedCommandTest, DepthMapsOfNoImageAreToldBeforeAnyWork) {
  BuildPipelineOptions options = Options("a.db");
  options.inputs.depth_path = Images();
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("images has no depth map of any image: there is no photo0.png.npy"));
  EXPECT_TRUE(Database(options.inputs.database_path).ReadImages().empty());
  RunBuildPipeline(Options("a.db"));
  EXPECT_EQ(RunBuildPipeline(options).summary.num_images_with_depth, 3);  // of an earlier run
}

TEST_F(RefusedCommandTest, ImagesOfAnotherProgramNeedNoMasks) {
  fs::create_directories(folder_ / "masks");
  WriteBitmap(folder_ / "masks/photo0.png.png", WallPhoto(160, 120, 0));
  BuildPipelineOptions options = Options("a.db");
  options.inputs.mask_path = folder_ / "masks";
  options.inputs.depth_path = "";
  options.inputs.stop_after = BuildStage::kFeatures;
  RunBuildPipeline(options);
  RunSql(folder_ / "a.db",
         "DELETE FROM cairn_jobs WHERE item = 4; DELETE FROM cairn_photos WHERE name = "
         "'photo3.png'");
  options.inputs.mask_path = "";
  TestMonitor monitor;
  RunBuildPipeline(options, {.monitor = monitor});
  EXPECT_THAT(monitor.warnings(), IsEmpty());
}

TEST_F(RefusedCommandTest, FeaturesOfASinglePhotographAreAResult) {
  for (int i = 1; i < 4; ++i) fs::remove(Images() + "/photo" + std::to_string(i) + ".png");
  BuildPipelineOptions options = Options("a.db");
  for (const BuildStage last : {BuildStage::kFeatures, BuildStage::kDepth}) {
    options.inputs.stop_after = last;
    EXPECT_EQ(RunBuildPipeline(options).run.failure, "");
  }
  options.inputs.stop_after = BuildStage::kPairs;
  EXPECT_THAT(RunBuildPipeline(options).run.failure, HasSubstr("one photograph alone"));
}

TEST_F(RefusedCommandTest, PositionsOfNoPhotographAreNamedWhateverThePairs) {
  BuildPipelineOptions options = Options("a.db");
  options.inputs.stop_after = BuildStage::kFeatures;
  options.inputs.gps_path = folder_ / "gps.csv";
  EXPECT_THROW(RunBuildPipeline(options), IoError);
  WriteFileAtomically(folder_ / "gps.csv", "name,lat,lon\nphoto0.png,45,7\nphoto1.PNG,45,7\n");
  TestMonitor monitor;
  RunBuildPipeline(options, {.monitor = monitor});
  EXPECT_THAT(monitor.warnings(),
              ElementsAre(HasSubstr("gps.csv: 1 of 2 names are of no image: photo1.PNG")));
}

TEST_F(RefusedCommandTest, AFolderThatIsNotThereIsFoundBeforeAnyWork) {
  BuildPipelineOptions options = Options("a.db");
  options.inputs.image_path = folder_ / "no_images";
  EXPECT_THAT(ThrownMessage<IoError>([&] { RunBuildPipeline(options); }),
              HasSubstr("no_images: no such folder"));
  EXPECT_FALSE(fs::exists(folder_ / "a.db"));
  options = Options("a.db");
  options.inputs.depth_path = folder_ / "no_depth";
  EXPECT_THAT(ThrownMessage<IoError>([&] { RunBuildPipeline(options); }),
              HasSubstr("no_depth: no such folder"));
  options.inputs.depth_path = "";
  options.inputs.mask_path = folder_ / "no_masks";
  EXPECT_THAT(ThrownMessage<IoError>([&] { RunBuildPipeline(options); }),
              HasSubstr("no_masks: no such folder"));
  options.inputs.mask_path = "";
  options.inputs.depth_model = folder_ / "no.onnx";
  EXPECT_THAT(ThrownMessage<IoError>([&] { RunBuildPipeline(options); }),
              HasSubstr("no.onnx: No such file"));
  options.inputs.image_path = "";
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("depth_model: needs --image_path"));
  EXPECT_FALSE(fs::exists(folder_ / "a.db"));
}

TEST_F(RefusedCommandTest, DepthIsNotLostForWantOfASource) {
  RunBuildPipeline(Options("a.db"));
  const std::string before = Dump("a.db");
  BuildPipelineOptions options = Options("a.db");
  options.inputs.recompute = BuildStage::kDepth;
  options.inputs.depth_path = "";
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("depth needs --depth_path or --depth_model"));
  options = Options("a.db");
  options.inputs.depth_model = "network.onnx";
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("cannot be given together"));
  EXPECT_EQ(Dump("a.db"), before);
}

TEST_F(RefusedCommandTest, DepthThatComesAfterVerificationIsAnError) {
  BuildPipelineOptions options = Options("a.db");
  options.inputs.depth_path = "";
  RunBuildPipeline(options);
  options.inputs.depth_path = folder_ / "depth";
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("without depth"));
  const std::string before = Dump("a.db");
  AddPhoto(4);
  EXPECT_THROW(RunBuildPipeline(options), ConfigError);
  EXPECT_EQ(Dump("a.db"), before);  // before it looks for features
  options.inputs.recompute = BuildStage::kVerification;
  EXPECT_EQ(RunBuildPipeline(options).summary.num_images_with_depth, 4);
}

TEST_F(RefusedCommandTest, RecomputeRefusesToLoseWhatItCannotMake) {
  RunBuildPipeline(Options("a.db"));
  BuildPipelineOptions options = Options("a.db");
  options.inputs.recompute = BuildStage::kFeatures;
  fs::remove(Images() + "/photo1.png");
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("photo1.png"));
  options.inputs.image_path = "";
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("needs --image_path"));
  RunSql(folder_ / "a.db", "DELETE FROM descriptors WHERE image_id = 2");
  options.inputs.recompute = BuildStage::kMatching;
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("no descriptors"));
}

TEST_F(RefusedCommandTest, ARefusedCommandTakesNothingFromTheDatabase) {
  RunBuildPipeline(Options("a.db"));
  const std::string before = Dump("a.db");
  fs::create_directories(folder_ / "no_masks");
  WriteFileAtomically(folder_ / "no.onnx", "no network");
  using Change = std::function<void(BuildPipelineOptions&)>;
  const std::vector<std::pair<BuildStage, Change>> refused = {
      {BuildStage::kPairs, [](auto& o) { o.inputs.pairs = "spatial"; }},
      {BuildStage::kFeatures, [&](auto& o) { o.inputs.mask_path = folder_ / "no_masks"; }},
      {BuildStage::kFeatures, [](auto& o) { o.inputs.pairs = "spatial"; }},
      {BuildStage::kMatching, [&](auto& o) { o.inputs.pairs_path = folder_ / "no.txt"; }},
      {BuildStage::kPairs, [&](auto& o) { o.inputs.gps_path = folder_ / "no.txt"; }},
      {BuildStage::kMatching, [](auto& o) { o.features.max_num_features = 77; }},
      {BuildStage::kCameras,
       [](auto& o) {
         o.cameras.camera_params = {1, 2};
       }},
      {BuildStage::kDepth,
       [&](auto& o) {
         o.inputs.depth_path = "";
         o.inputs.depth_model = folder_ / "no.onnx";
       }},
  };
  for (const auto& [stage, change] : refused) {
    BuildPipelineOptions options = Options("a.db");
    options.inputs.recompute = stage;
    change(options);
    EXPECT_THROW(RunBuildPipeline(options), std::runtime_error) << NameOf(kBuildStages, stage);
    EXPECT_EQ(Dump("a.db"), before) << NameOf(kBuildStages, stage);
  }
  fs::remove(Images() + "/photo3.png");
  BuildPipelineOptions options = Options("a.db");
  options.inputs.drop_missing = true;
  options.inputs.mask_path = folder_ / "no_masks";
  EXPECT_THROW(RunBuildPipeline(options), ConfigError);
  EXPECT_EQ(Dump("a.db"), before);
}

TEST_F(RefusedCommandTest, NothingVerifiedIsNoUsableResult) {
  BuildPipelineOptions options = Options("a.db");
  options.verification.min_num_matches = 100000;
  const BuildPipelineReport report = RunBuildPipeline(options);
  EXPECT_THAT(report.run.failure, HasSubstr("verification: of 6 pairs none was verified"));
  EXPECT_EQ(report.summary.num_too_few, 6);
}

TEST_F(RefusedCommandTest, PhotographsWithoutFeaturesAreNamed) {
  fs::create_directories(folder_ / "masks");
  for (int i = 0; i < 4; ++i) {
    Bitmap black{160, 120, 1, std::vector<uint8_t>(160 * 120, 0)};
    WriteBitmap(folder_ / ("masks/photo" + std::to_string(i) + ".png.png"), black);
  }
  BuildPipelineOptions options = Options("a.db");
  options.inputs.mask_path = folder_ / "masks";
  options.inputs.depth_path = "";
  TestMonitor monitor;
  const BuildPipelineReport report = RunBuildPipeline(options, {.monitor = monitor});
  EXPECT_EQ(report.summary.num_images_with_features, 0);
  EXPECT_THAT(report.run.failure, HasSubstr("no image has features"));
  EXPECT_THAT(monitor.warnings(),
              Contains(AllOf(HasSubstr("no features in 4 photographs"), HasSubstr("photo0.png"))));
}

TEST_F(RefusedCommandTest, WithoutImagesTheDatabaseMustBeThere) {
  BuildPipelineOptions options = Options("absent.db");
  options.inputs.image_path = "";
  EXPECT_THROW(RunBuildPipeline(options), IoError);
  EXPECT_FALSE(fs::exists(folder_ / "absent.db"));
}

}  // namespace
}  // namespace cairn
