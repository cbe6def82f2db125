#include "pipeline/stages/stage_ledger.h"

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/matching/matching.h"
#include "database/stage_names.h"
#include "pipeline/stages/recompute.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/thrown_message.h"

namespace cairn {
namespace {

std::string Text(const MatchingOptions& options) { return DumpQualified("matching", options); }

TEST(StageLedger, OptionsTextHasTheNamesOfTheFlags) {
  MatchingOptions options;
  options.max_ratio = 0.75;
  EXPECT_THAT(Text(options), HasSubstr("matching.max_ratio = 0.75\n"));
  EXPECT_THAT(Text(options), HasSubstr("matching.cross_check = true\n"));
}

TEST(StageLedger, NamesTheOptionThatDiffers) {
  Database database(":memory:");
  MatchingOptions options;
  StageLedger ledger(database, kStageMatching, Text(options));
  ledger.Begin(database);
  EXPECT_FALSE(database.ReadStage(kStageMatching)->is_complete);
  options.max_ratio = 0.5;
  EXPECT_EQ(
      ThrownMessage<ConfigError>([&] { StageLedger(database, kStageMatching, Text(options)); }),
      "matching.max_ratio: is 0.5, but the database's stage 'matching' was made with 0.8; "
      "use the same, or --recompute matching");
  EXPECT_THAT(ThrownMessage<ConfigError>([&] {
                StageLedger(database, kStageMatching, Text(options) + "matching.new = 1\n");
              }),
              HasSubstr("matching.max_ratio"));
  EXPECT_THAT(ThrownMessage<ConfigError>(
                  [&] { StageLedger(database, kStageMatching, Text({}) + "matching.new = 1\n"); }),
              HasSubstr("matching.new: the database's stage 'matching' was made by a version"));
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { StageLedger(database, kStageMatching, ""); }),
              HasSubstr("no longer an option"));
}

TEST(StageLedger, AnOptionThatWasTakenOutMayHaveHadTodaysValue) {
  Database database(":memory:");
  database.WriteStage({kStageVerification, "verification.max_num_refined = 60\n", true});
  EXPECT_NO_THROW(StageLedger(database, kStageVerification, ""));
  database.WriteStage({kStageVerification, "verification.max_num_refined = 6\n", true});
  EXPECT_THROW(StageLedger(database, kStageVerification, ""), ConfigError);
}

TEST(StageLedger, KnowsWhatIsDoneFromWhichInputs) {
  Database database(":memory:");
  {
    StageLedger ledger(database, kStageDepth, "a = 1\n");
    ledger.Begin(database);
    database.WriteJob(kStageDepth, {3, 77, ""});
  }
  const StageLedger ledger(database, kStageDepth, "a = 1\n");
  EXPECT_TRUE(ledger.IsDone(3, 77, "x"));
  EXPECT_FALSE(ledger.IsDone(4, 77, "x"));
  EXPECT_EQ(ledger.Find(4), nullptr);
  EXPECT_EQ(ThrownMessage<ConfigError>([&] { ledger.IsDone(3, 78, "the photograph a.jpg"); }),
            "database: the photograph a.jpg changed since the stage 'depth' was computed; use "
            "--recompute depth");
}

TEST(StageLedger, BeginAndCompleteAreRecorded) {
  Database database(":memory:");
  StageLedger ledger(database, kStageDepth, "a = 1\n");
  ledger.Begin(database);
  EXPECT_FALSE(database.ReadStage(kStageDepth)->is_complete);
  ledger.Complete(database);
  EXPECT_TRUE(database.ReadStage(kStageDepth)->is_complete);
}

TEST(StageLedger, AStageThatNeverBeganLeavesNoRecord) {
  Database database(":memory:");
  StageLedger(database, kStageDepth, "a = 1\n").Complete(database);
  EXPECT_FALSE(database.ReadStage(kStageDepth));
}

TEST(StageLedger, ClearingAStageClearsWhatDependsOnIt) {
  const TempFolder photos;
  WriteFileAtomically(photos / "a", "");
  const auto stages_left = [&photos](BuildStage cleared) {
    Database database(":memory:");
    database.WriteCamera(Camera::FromFocal(1, CameraModel::kPinhole, 10, 10, 10));
    database.WriteImage({1, "a", 1});
    database.WriteImage({2, "b", 1});
    database.WriteKeypoints(1, std::vector<Keypoint>(1));
    for (const image_t id : {1, 2}) database.WriteDescriptors(id, Descriptors::Random(1, 128));
    database.WriteDepthSamples(1, std::vector<DepthSample>(1));
    database.WritePairChoice({ImagePairToPairId(1, 2), 0, "spatial"});
    database.WriteMatches(ImagePairToPairId(1, 2), {{0, 0}});
    database.WriteTwoViewGeometry(ImagePairToPairId(1, 2), {});
    for (const std::string& stage : {kStageCameras, kStageFeatures, kStageDepth, kStagePairs,
                                     kStageMatching, kStageVerification}) {
      database.WriteStage({stage, "", true});
    }
    PrepareRecompute(database, cleared, photos.path(), {});
    std::string left;
    if (database.ReadKeypoints(1)) left += "features ";
    EXPECT_EQ(database.ReadKeypoints(1).has_value(), database.ReadDescriptors(1).has_value());
    if (database.ReadDepthSamples(1)) left += "depth ";
    if (!database.ReadPairChoices().empty()) left += "pairs ";
    if (database.ReadMatches(ImagePairToPairId(1, 2))) left += "matching ";
    if (database.ReadTwoViewGeometry(ImagePairToPairId(1, 2))) left += "verification ";
    for (const std::string& stage :
         {kStageFeatures, kStageDepth, kStagePairs, kStageMatching, kStageVerification}) {
      EXPECT_EQ(database.ReadStage(stage).has_value(), left.find(stage) != std::string::npos);
    }
    return left;
  };
  EXPECT_EQ(stages_left(BuildStage::kFeatures), "");
  EXPECT_EQ(stages_left(BuildStage::kDepth), "features pairs matching ");
  EXPECT_EQ(stages_left(BuildStage::kPairs), "features depth ");
  EXPECT_EQ(stages_left(BuildStage::kMatching), "features depth pairs ");
  EXPECT_EQ(stages_left(BuildStage::kVerification), "features depth pairs matching ");
  EXPECT_EQ(stages_left(BuildStage::kCameras), "features depth pairs matching ");
}

// What other programs wrote and we cannot make again.
TEST(StageLedger, NothingIsClearedThatWouldBeLost) {
  const TempFolder folder;
  const image_pair_t pair = ImagePairToPairId(1, 2);
  const auto refusal = [&](BuildStage stage, auto change) {
    const std::string path = folder / "a.db";
    std::filesystem::remove(path);
    Database database(path);
    database.WriteCamera(Camera::FromFocal(1, CameraModel::kPinhole, 10, 10, 10));
    for (const image_t id : {1, 2}) {
      database.WriteImage({id, std::to_string(id), 1});
      database.WriteKeypoints(id, std::vector<Keypoint>(1));
      database.WriteDescriptors(id, Descriptors::Random(1, 128));
    }
    TwoViewGeometry geometry;
    geometry.inlier_matches = {{0, 0}};
    database.WriteTwoViewGeometry(pair, geometry);
    change(database);
    const std::string before = DumpDatabase(path);
    const std::string message = ThrownMessage<ConfigError>([&] {
      PrepareRecompute(database, stage, "", {"/nowhere", ""});
    });
    EXPECT_TRUE(DumpDatabase(path) == before);
    return message;
  };
  const auto none = [](Database&) {};
  for (const BuildStage stage : {BuildStage::kVerification, BuildStage::kDepth}) {
    EXPECT_THAT(refusal(stage, none), HasSubstr("the inliers would be lost"));
  }
  const auto add_matches = [&](Database& database) { database.WriteMatches(pair, {{0, 0}}); };
  EXPECT_THAT(refusal(BuildStage::kDepth,
                      [&](Database& database) {
                        add_matches(database);
                        database.WriteDepthSamples(1, std::vector<DepthSample>(1));
                      }),
              HasSubstr("1 has no source of it here"));
  for (const BuildStage stage : {BuildStage::kPairs, BuildStage::kMatching}) {
    EXPECT_THAT(refusal(stage,
                        [&](Database& database) {
                          database.WriteDescriptors(2, Descriptors::Random(1, 256));
                        }),
                HasSubstr("its descriptors cannot be matched"));
  }
}

}  // namespace
}  // namespace cairn
