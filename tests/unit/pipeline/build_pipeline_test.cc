// All stages together, with the real verifiers.

#include "cairn/pipeline/build_pipeline.h"

#include <filesystem>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "support/thrown_message.h"
#include "unit/pipeline/wall_fixture.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;
using ::testing::Field;

class BuildPipelineTest : public WallTest {
 protected:
  BuildPipelineTest() : WallTest(4, 8) {}
};

TEST_F(BuildPipelineTest, FromPhotographsToVerifiedPairs) {
  const BuildPipelineReport report = RunBuildPipeline(Options("a.db"));
  EXPECT_FALSE(report.was_stopped);
  ASSERT_EQ(report.run.stages.size(), 6u);
  EXPECT_EQ(report.summary.num_images, 4);
  EXPECT_EQ(report.summary.num_images_with_features, 4);
  EXPECT_EQ(report.summary.num_images_with_depth, 3);
  EXPECT_EQ(report.summary.num_pairs, 6);
  EXPECT_EQ(report.summary.num_tried + report.summary.num_too_few, 6);
  const Database database(folder_ / "a.db", Database::Mode::kReadOnly);
  EXPECT_EQ(database.ReadNumInliers().size(), 6u);
  EXPECT_EQ(database.ReadPairMetrics().size(), 1u * report.summary.num_tried);
  EXPECT_THAT(SummaryText(report.summary, report.run),
              HasSubstr("4 (4 with features, 3 with depth)"));
  int64_t num_decided = 0;
  for (const auto& [step, num_pairs, seconds] : report.summary.decided_by) {
    num_decided += num_pairs;
    EXPECT_GT(seconds, 0);
    EXPECT_THAT(SummaryText(report.summary, report.run),
                HasSubstr(" " + step + " " + std::to_string(num_pairs) + " ("));
  }
  EXPECT_EQ(num_decided, report.summary.num_tried);
  EXPECT_EQ(database.ReadPairMetrics()[0].verifier, "cascade");
}

TEST_F(BuildPipelineTest, DumpsAreEqualForAnyNumberOfThreads) {
  for (const int num_threads : {1, 2, 8}) {
    BuildPipelineOptions options = Options(std::to_string(num_threads) + ".db");
    RunBuildPipeline(options, {.num_threads = num_threads});
  }
  const std::string dump = Dump("1.db");
  EXPECT_THAT(dump, HasSubstr("two_view_geometries: "));
  EXPECT_EQ(Dump("2.db"), dump);
  EXPECT_EQ(Dump("8.db"), dump);
}

TEST_F(BuildPipelineTest, TellsThatThereIsNoDepth) {
  BuildPipelineOptions options = Options("a.db");
  options.inputs.depth_path = "";
  const BuildPipelineReport report = RunBuildPipeline(options);
  EXPECT_THAT(SummaryText(report.summary, report.run),
              HasSubstr("depth     no photograph has any"));
}

TEST(SummaryText, OfAnotherProgramsDatabaseTellsNothingOfOurVerification) {
  ViewGraphSummary summary;
  summary.num_images = 3;
  summary.num_pairs = 3;
  summary.num_verified = 2;
  summary.verified_by = {{"given", 2}};
  const std::string text = SummaryText(summary, {});
  EXPECT_THAT(text, HasSubstr("pairs     3\nverified  2 (given 2)\n"));
  EXPECT_THAT(text, Not(HasSubstr("rejected")));
}

TEST_F(BuildPipelineTest, BothVerifiersRunOnEveryPair) {
  BuildPipelineOptions options = Options("both.db");
  options.inputs.verifier = VerifierChoice::kBoth;
  const BuildPipelineReport report = RunBuildPipeline(options);
  const Database database(folder_ / "both.db", Database::Mode::kReadOnly);
  EXPECT_EQ(database.ReadPairMetrics().size(), 2u * report.summary.num_tried);
}

// Stopped after every few items, whatever the stage, then continued.
TEST_F(BuildPipelineTest, InterruptedRunsEndInTheSameDump) {
  RunBuildPipeline(Options("whole.db"));
  int num_stops = 0;
  for (; num_stops < 50; ++num_stops) {
    TestMonitor monitor(5);
    if (!RunBuildPipeline(Options("parts.db"), {.monitor = monitor}).was_stopped) break;
    EXPECT_THAT(monitor.warnings(), Not(Contains(HasSubstr("no features"))));
  }
  EXPECT_GE(num_stops, 3);
  EXPECT_LT(num_stops, 50);
  EXPECT_EQ(Dump("parts.db"), Dump("whole.db"));
}

TEST_F(BuildPipelineTest, StopAfterAndContinue) {
  RunBuildPipeline(Options("whole.db"));
  const std::map<BuildStage, size_t> num_stages = {{BuildStage::kFeatures, 2},
                                                   {BuildStage::kDepth, 3},
                                                   {BuildStage::kPairs, 4},
                                                   {BuildStage::kMatching, 5},
                                                   {BuildStage::kVerification, 6}};
  for (const auto& [stage, num] : num_stages) {
    BuildPipelineOptions options = Options("parts.db");
    options.inputs.stop_after = stage;
    const BuildPipelineReport report = RunBuildPipeline(options);
    EXPECT_EQ(report.run.stages.size(), num);
    EXPECT_EQ(report.summary.num_pairs, stage < BuildStage::kPairs ? 0 : 6);
  }
  EXPECT_EQ(Dump("parts.db"), Dump("whole.db"));
}

TEST_F(BuildPipelineTest, OptionsThatDifferAreNamedAndRecomputedOnRequest) {
  RunBuildPipeline(Options("a.db"));
  const auto rows = [&](const std::string& table) {
    return RunSql(folder_ / "a.db", "SELECT * FROM " + table);
  };
  // table: of what the stage computes.
  const auto expect = [&](BuildStage stage, const std::string& table, const std::string& option,
                          auto change, uint64_t seed = 0) {
    const SqlRows default_rows = rows(table);
    BuildPipelineOptions options = Options("a.db");
    change(options);
    EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options, {.seed = seed}); }),
                HasSubstr(option + ": is"));
    options.inputs.recompute = stage;
    RunBuildPipeline(options, {.seed = seed});
    EXPECT_TRUE(rows(table) != default_rows) << option;
    BuildPipelineOptions fresh = options;
    fresh.inputs.recompute = BuildStage::kNone;
    fresh.inputs.database_path = folder_ / "fresh.db";
    fs::remove(folder_ / "fresh.db");
    RunBuildPipeline(fresh, {.seed = seed});
    EXPECT_EQ(Dump("a.db"), Dump("fresh.db")) << NameOf(kBuildStages, stage);
    options = Options("a.db");
    options.inputs.recompute = stage;
    RunBuildPipeline(options);
    EXPECT_TRUE(rows(table) == default_rows) << option;
  };
  expect(BuildStage::kFeatures, "keypoints", "features.max_num_features",
         [](BuildPipelineOptions& o) { o.features.max_num_features = 60; });
  expect(BuildStage::kDepth, "cairn_depth_scales", "depth.scale",
         [](BuildPipelineOptions& o) { o.depth.scale = 2; });
  expect(BuildStage::kMatching, "matches", "matching.max_ratio",
         [](BuildPipelineOptions& o) { o.matching.max_ratio = 0.6; });
  expect(BuildStage::kVerification, "two_view_geometries", "verification.min_num_inliers",
         [](BuildPipelineOptions& o) { o.verification.min_num_inliers = 1000; });
  expect(
      BuildStage::kVerification, "cairn_pair_metrics", "seed", [](BuildPipelineOptions&) {}, 1);
  expect(BuildStage::kVerification, "two_view_geometries", "verifier",
         [](BuildPipelineOptions& o) { o.inputs.verifier = VerifierChoice::kFivePoint; });
  expect(BuildStage::kCameras, "cameras", "camera_model",
         [](BuildPipelineOptions& o) { o.cameras.camera_model = CameraModel::kPinhole; });
}

TEST_F(BuildPipelineTest, NewPhotographsJoin) {
  RunBuildPipeline(Options("a.db"));
  const Database before(folder_ / "a.db");
  const std::vector<Keypoint> keypoints = *before.ReadKeypoints(1);
  AddPhoto(4);
  TestMonitor monitor;
  const BuildPipelineReport report = RunBuildPipeline(Options("a.db"), {.monitor = monitor});
  EXPECT_EQ(report.summary.num_images, 5);
  EXPECT_EQ(report.summary.num_pairs, 10);
  EXPECT_THAT(monitor.totals(), ElementsAre(5, 1, 1, 4, 4));
  EXPECT_EQ(*Database(folder_ / "a.db").ReadKeypoints(1), keypoints);
}

TEST_F(BuildPipelineTest, NewPhotographsBeginWithTheLensOfTheirKind) {
  RunBuildPipeline(Options("a.db"));
  const CameraLens lens{.focal_px = 150, .k = -0.01, .num_pairs = 5};
  {
    Database database(folder_ / "a.db");
    for (camera_t id = 1; id <= 4; ++id) database.WriteCameraLens(id, lens);
  }
  AddPhoto(4);
  RunBuildPipeline(Options("a.db"));
  const CameraLens later = Database(folder_ / "a.db").ReadCameraLenses().at(5);
  EXPECT_EQ(later.focal_px, lens.focal_px);
  EXPECT_EQ(later.k, lens.k);
}

TEST_F(BuildPipelineTest, ChangedPhotographsAreComputedAlone) {
  RunBuildPipeline(Options("a.db"));
  WriteBitmap(Images() + "/photo1.png", WallPhoto(160, 120, 60));
  BuildPipelineOptions options = Options("a.db");
  options.inputs.recompute = BuildStage::kChanged;
  TestMonitor monitor;
  const BuildPipelineReport report = RunBuildPipeline(options, {.monitor = monitor});
  EXPECT_EQ(report.summary.num_images, 4);
  EXPECT_EQ(report.summary.num_pairs, 6);
  EXPECT_THAT(monitor.totals(), ElementsAre(4, 1, 1, 3, 3));
  options.inputs.image_path = "";
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("changed needs --image_path"));
}

TEST_F(BuildPipelineTest, DoubtfulCameraParamsAreInTheReportAndAtTheEndOfTheSummary) {
  BuildPipelineOptions options = Options("a.db");
  options.cameras.camera_model = CameraModel::kPinhole;
  options.cameras.camera_params = {190, 190, 120, 60};
  options.inputs.stop_after = BuildStage::kFeatures;
  const BuildPipelineReport report = RunBuildPipeline(options);
  EXPECT_THAT(SummaryText(report.summary, report.run),
              HasSubstr("\nwarning   the given principal point 120,60 is far from the center"));
  EXPECT_THAT(ToJson(report.run), HasSubstr("\"advice\": \"are camera_model and the order right?"));
}

// As `colmap database_cleaner` deletes them, or somebody with SQL.
TEST_F(BuildPipelineTest, RowsThatAnotherProgramDeletedAreComputedAgain) {
  RunBuildPipeline(Options("a.db"));
  const std::string dump = Dump("a.db");
  for (const std::vector<std::string>& cleaned : std::vector<std::vector<std::string>>{
           {"matches", "two_view_geometries"},
           {"keypoints", "descriptors", "matches", "two_view_geometries"},
           {"keypoints", "descriptors", "matches", "two_view_geometries", "images", "cameras"},
           {"two_view_geometries WHERE pair_id % 2 = 0"},
           {"cairn_depth_scales WHERE image_id = 2"}}) {
    for (const std::string& rows : cleaned) RunSql(folder_ / "a.db", "DELETE FROM " + rows);
    const BuildPipelineReport report = RunBuildPipeline(Options("a.db"));
    EXPECT_EQ(report.summary.num_images, 4) << cleaned.back();
    EXPECT_EQ(report.summary.num_tried + report.summary.num_too_few, 6) << cleaned.back();
    EXPECT_TRUE(Dump("a.db") == dump) << cleaned.back();
  }
  RunSql(folder_ / "a.db", "DELETE FROM images WHERE image_id = 2");
  EXPECT_THAT(
      RunBuildPipeline(Options("a.db")).summary,
      AllOf(Field(&ViewGraphSummary::num_images, 4), Field(&ViewGraphSummary::num_pairs, 6)));
}

TEST_F(BuildPipelineTest, PairsThatAnotherProgramMatchedAndDeletedAreMatched) {
  RunBuildPipeline(Options("a.db"));
  for (const std::string table : {"jobs", "stages", "pair_choices", "pair_metrics"}) {
    RunSql(folder_ / "a.db", "DELETE FROM cairn_" + table);
  }
  AddPhoto(4);
  BuildPipelineOptions options = Options("a.db");
  options.inputs.depth_path = "";
  EXPECT_EQ(RunBuildPipeline(options).summary.verified_by.count("given"), 1u);
  for (const std::string table : {"matches", "two_view_geometries"}) {
    RunSql(folder_ / "a.db", "DELETE FROM " + table);
  }
  const ViewGraphSummary summary = RunBuildPipeline(options).summary;
  EXPECT_EQ(summary.num_pairs, 10);
  EXPECT_EQ(summary.num_tried + summary.num_too_few, 10);
}

// However often cairn saw them before.
TEST_F(BuildPipelineTest, MatchesOfAnotherProgramThatAreGoneAreMatchedByOurs) {
  RunBuildPipeline(Options("ours.db"));
  for (const std::string table : {"jobs", "stages", "pair_choices", "pair_metrics",
                                  "focal_evidence", "camera_focals", "camera_lenses"}) {
    RunSql(folder_ / "ours.db", "DELETE FROM cairn_" + table);
  }
  const auto options_of = [this](const std::string& database) {
    BuildPipelineOptions options = Options(database);
    options.inputs.depth_path = "";
    return options;
  };
  const auto delete_pairs = [this](const std::string& database) {
    for (const std::string table : {"matches", "two_view_geometries"}) {
      RunSql(folder_ / database, "DELETE FROM " + table);
    }
  };
  for (const std::string name : {"fresh.db", "recomputed.db", "deleted.db"}) {
    fs::copy_file(folder_ / "ours.db", folder_ / name);
    if (name == "fresh.db") delete_pairs(name);
    const ViewGraphSummary summary = RunBuildPipeline(options_of(name)).summary;
    EXPECT_EQ(summary.verified_by.count("given"), name == "fresh.db" ? 0u : 1u);
  }
  BuildPipelineOptions recompute = options_of("recomputed.db");
  recompute.inputs.recompute = BuildStage::kMatching;
  EXPECT_EQ(RunBuildPipeline(recompute).summary.num_pairs, 6);
  EXPECT_EQ(Dump("recomputed.db"), Dump("fresh.db"));
  delete_pairs("deleted.db");
  EXPECT_EQ(RunBuildPipeline(options_of("deleted.db")).summary.num_pairs, 6);
  EXPECT_EQ(Dump("deleted.db"), Dump("fresh.db"));
}

TEST_F(BuildPipelineTest, ADepthMapThatComesLaterIsUsed) {
  RunBuildPipeline(Options("a.db"));
  WriteNpy(folder_ / "depth/photo2.png.npy", 16, 12, std::vector<float>(16 * 12, 2.2f));
  TestMonitor monitor;
  const BuildPipelineReport report = RunBuildPipeline(Options("a.db"), {.monitor = monitor});
  EXPECT_EQ(report.summary.num_images_with_depth, 4);
  EXPECT_THAT(monitor.totals(), ElementsAre(4, 1, 3));  // its pairs are verified again
  EXPECT_THAT(monitor.notes(), Contains(HasSubstr("photo2.png")));
  const std::string dump = Dump("a.db");
  RunBuildPipeline(Options("a.db"));
  EXPECT_EQ(Dump("a.db"), dump);
  RunBuildPipeline(Options("fresh.db"));
  EXPECT_EQ(Dump("fresh.db"), dump);
}

TEST_F(BuildPipelineTest, DepthThatWasLeftOutOnceIsUsedLater) {
  RunBuildPipeline(Options("a.db"));
  AddPhoto(4);
  BuildPipelineOptions without = Options("a.db");
  without.inputs.depth_path = "";
  EXPECT_EQ(RunBuildPipeline(without).summary.num_images_with_depth, 3);
  TestMonitor monitor;
  const BuildPipelineReport report = RunBuildPipeline(Options("a.db"), {.monitor = monitor});
  EXPECT_EQ(report.summary.num_images_with_depth, 4);
  EXPECT_THAT(monitor.totals(), ElementsAre(5, 1, 4));
}

TEST_F(BuildPipelineTest, PairsOfAnEarlierListAreVerifiedAgain) {
  BuildPipelineOptions options = Options("a.db");
  options.inputs.pairs_path = folder_ / "pairs.txt";
  WriteFileAtomically(options.inputs.pairs_path, "photo0.png photo2.png\n");
  RunBuildPipeline(options);
  WriteNpy(folder_ / "depth/photo2.png.npy", 16, 12, std::vector<float>(16 * 12, 2.2f));
  WriteFileAtomically(options.inputs.pairs_path, "photo0.png photo1.png\n");
  RunBuildPipeline(options);
  EXPECT_THAT(Database(folder_ / "a.db").ReadNumInliers(),
              ElementsAre(Field(&std::pair<image_pair_t, int>::first, ImagePairToPairId(1, 2)),
                          Field(&std::pair<image_pair_t, int>::first, ImagePairToPairId(1, 3))));
}

TEST_F(BuildPipelineTest, MatchesWithoutDescriptorsOfAnotherProgramAreNamed) {
  RunBuildPipeline(Options("a.db"));
  RunSql(folder_ / "a.db", "DELETE FROM cairn_jobs");
  RunSql(folder_ / "a.db", "DELETE FROM cairn_stages");
  RunSql(folder_ / "a.db", "DELETE FROM descriptors WHERE image_id = 1");
  const BuildPipelineReport report = RunBuildPipeline(Options("a.db"));
  std::string texts;
  for (const ResultWarning& warning : report.run.warnings) texts += warning.what + "\n";
  EXPECT_THAT(texts, HasSubstr("1 images have matches, but no descriptors"));
}

TEST_F(BuildPipelineTest, AListThatIsLeftOutIsMissed) {
  BuildPipelineOptions options = Options("a.db");
  options.inputs.pairs_path = folder_ / "pairs.txt";
  WriteFileAtomically(options.inputs.pairs_path, "photo0.png photo2.png\n");
  RunBuildPipeline(options);
  options.inputs.pairs_path = "";
  options.inputs.recompute = BuildStage::kMatching;
  TestMonitor monitor;
  RunBuildPipeline(options, {.monitor = monitor});
  EXPECT_THAT(monitor.warnings(), Contains(HasSubstr("earlier runs took the pairs of a list")));
}

TEST_F(BuildPipelineTest, DeletedPairsThatCannotBeHadAgainAreNotCounted) {
  RunBuildPipeline(Options("a.db"));
  for (const std::string table : {"matches", "two_view_geometries", "descriptors"}) {
    RunSql(folder_ / "a.db", "DELETE FROM " + table);
  }
  const BuildPipelineReport report = RunBuildPipeline(Options("a.db"));
  EXPECT_EQ(report.summary.num_verified, 0);
  EXPECT_THAT(report.run.failure, HasSubstr("none was verified"));
}

// Else it could have any file of this machine read into it.
TEST_F(BuildPipelineTest, ADatabaseFromElsewhereNamesNoFilesAndAsksForNoWork) {
  RunBuildPipeline(Options("a.db"));
  Database database(folder_ / "a.db");
  database.WriteStage({"dataset",
                       "image_path = \"/secret\"\n\"mask_path\" = \"/secret\"\n[depth]\nmodel = 1\n"
                       "drop_missing = true\nrecompute = \"cameras\"\nverifier = \"two_ac\"\n",
                       true});
  EXPECT_THAT(StoredOptions(Options("a.db").inputs),
              Contains("model = 1\nverifier = \"two_ac\"\n"));
}

// Keypoints with four columns are COLMAP's.
TEST_F(BuildPipelineTest, NewPhotographsGetSiftFeaturesWhereOthersHaveThem) {
  const auto stored = [&] { return StoredOptions(Options("a.db").inputs); };
  BuildPipelineOptions options = Options("a.db");
  options.features.type = FeatureType::kSift;
  RunBuildPipeline(options);
  EXPECT_THAT(stored(), Not(Contains("features.type = \"sift\"\n")));
  for (const std::string table : {"jobs", "stages"}) {
    RunSql(folder_ / "a.db", "DELETE FROM cairn_" + table);
  }
  EXPECT_THAT(stored(), ElementsAre("features.type = \"sift\"\n"));
  AddPhoto(4);
  options.inputs.depth_path = "";
  options.inputs.stop_after = BuildStage::kFeatures;
  TestMonitor sift, affine;
  RunBuildPipeline(options, {.monitor = sift});
  EXPECT_THAT(sift.warnings(), ElementsAre());
  RunSql(folder_ / "a.db", "DELETE FROM cairn_stages WHERE stage = 'features'");
  AddPhoto(5);
  options.features.type = FeatureType::kAffineDog;
  RunBuildPipeline(options, {.monitor = affine});
  EXPECT_THAT(affine.warnings(), ElementsAre(HasSubstr("use --features.type sift")));
}

}  // namespace
}  // namespace cairn
