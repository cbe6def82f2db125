#include <cstdio>
#include <filesystem>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/rng.h"
#include "cairn/image/exif.h"
#include "database/stage_names.h"
#include "pipeline/pairs/candidates.h"
#include "pipeline/pairs/choose.h"
#include "pipeline/pairs/exhaustive.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "support/thrown_message.h"
#include "unit/pipeline/wall_fixture.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;

constexpr int kPointsPerPlace = 10;

std::string Name(int i) {
  char name[20];
  std::snprintf(name, sizeof(name), "img%03d.jpg", i);
  return name;
}

// `num` images without photographs on a ring: image i + 1 has the places i, i + 1, i + 2.
class RingDatabase {
 public:
  explicit RingDatabase(int num) : points_(num * kPointsPerPlace, 128) {
    Rng rng(1);
    for (Eigen::Index k = 0; k < points_.size(); ++k) {
      const double value = rng.Gaussian();
      points_.data()[k] = static_cast<uint8_t>(std::min(255.0, 45 * value * value));
    }
    Camera camera;
    camera.camera_id = 1;
    camera.width = camera.height = 100;
    camera.model = CameraModel::kSimplePinhole;
    camera.params = {100, 50, 50};
    database.WriteCamera(camera);
    for (int i = 0; i < num; ++i) AddImage(i);
  }
  void AddImage(int i) {
    Descriptors descriptors(3 * kPointsPerPlace, 128);
    for (int k = 0; k < 3 * kPointsPerPlace; ++k) {
      descriptors.row(k) = points_.row((i * kPointsPerPlace + k) % points_.rows());
    }
    const auto id = static_cast<image_t>(i + 1);
    database.WriteImage({.image_id = id, .name = Name(i), .camera_id = 1});
    database.WriteKeypoints(id, std::vector<Keypoint>(3 * kPointsPerPlace));
    database.WriteDescriptors(id, descriptors);
  }
  // Pairs by reason, of a first round.
  std::map<std::string, int> Choose(const PairChoosing& choosing) {
    PairChooser(database, choosing, {.num_threads = 2}).ChooseFirst();
    std::map<std::string, int> counts;
    for (const PairChoiceRecord& choice : database.ReadPairChoices()) ++counts[choice.reason];
    return counts;
  }

  Database database{":memory:"};

 private:
  Descriptors points_;
};

using Counts = std::map<std::string, int>;

Counts ChooseOnRing(const PairChoosing& choosing) { return RingDatabase(20).Choose(choosing); }

TEST(ChoosePairs, AutoIsExhaustiveForFewImages) {
  EXPECT_EQ(ChooseOnRing({}), (Counts{{"exhaustive", 190}}));
  EXPECT_EQ(ChooseOnRing({.ways = "exhaustive"}), (Counts{{"exhaustive", 190}}));
}

// 190 images are 17955 pairs: more than a minute of two cores, by their number alone.
TEST(ChoosePairs, AutoIsRetrievalForManyImagesWithWhatNamesTell) {
  EXPECT_EQ(RingDatabase(190).Choose({.options = {.retrieval_neighbors = 4}}),
            (Counts{{"sequential", 2 * 190 - 3}, {"retrieval", 3}}));
}

TEST(ChoosePairs, WorkOfAllPairs) {
  const MatchOrigins none(Database(":memory:"));
  std::map<image_t, int> few, many;
  for (image_t id = 1; id <= 50; ++id) few[id] = 8000;    // 87 s of products, 9 s of pairs
  for (image_t id = 1; id <= 128; ++id) many[id] = 8000;  // 620 s and 57 s
  EXPECT_NEAR(ExhaustiveSeconds(few, none), 102, 1);
  EXPECT_NEAR(ExhaustiveSeconds(many, none), 677, 1);
  EXPECT_EQ(ExhaustivePairs(few, none).size(), 1225u);
}

TEST(ChoosePairs, EachWayAndItsOptions) {
  PairChoosing sequential{.ways = "sequential", .options = {.overlap = 2}};
  EXPECT_EQ(ChooseOnRing(sequential), (Counts{{"sequential", 19 + 18 + 16}}));
  sequential.options.quadratic_overlap = false;
  EXPECT_EQ(ChooseOnRing(sequential), (Counts{{"sequential", 19 + 18}}));
  PairChoosing retrieval{.ways = "retrieval", .options = {.retrieval_neighbors = 2}};
  EXPECT_EQ(ChooseOnRing(retrieval), (Counts{{"retrieval", 20}}));
  retrieval.options.retrieval_neighbors = 4;
  EXPECT_EQ(ChooseOnRing(retrieval), (Counts{{"retrieval", 40}}));
  PairChoosing both{
      .ways = "retrieval,sequential",
      .options = {.overlap = 1, .quadratic_overlap = false, .retrieval_neighbors = 2}};
  EXPECT_EQ(ChooseOnRing(both), (Counts{{"retrieval", 1}, {"sequential", 19}}));
}

TEST(ChoosePairs, FewerWordsFindOtherCandidates) {
  const RingDatabase ring(60);
  const auto candidates = [&](int num_words) {
    const DescribedImages images = DescribeImages(ring.database, {.num_words = num_words}, {});
    Queries all;
    for (const image_t id : images.ids) all[id];
    return FindCandidates(images, all, 12, 1);
  };
  EXPECT_EQ(candidates(64), candidates(64));
  EXPECT_NE(candidates(64), candidates(2));
}

TEST(ChoosePairs, SpatialByAFileOfPositions) {
  const TempFolder folder;
  std::string text = "# name,latitude,longitude\n";
  for (int i = 0; i < 19; ++i) text += Name(i) + ",45.0, " + std::to_string(0.001 * i) + "\n";
  WriteFileAtomically(folder / "gps.csv", text);  // 79 m from one to the next; the last has none
  PairChoosing spatial{.ways = "spatial",
                       .options = {.spatial_neighbors = 2, .spatial_radius_m = 100},
                       .gps_path = folder / "gps.csv"};
  EXPECT_EQ(ChooseOnRing(spatial), (Counts{{"spatial", 18}}));
  spatial.options.spatial_radius_m = 160;
  EXPECT_EQ(ChooseOnRing(spatial), (Counts{{"spatial", 18 + 2}}));  // at both ends
  spatial.options.spatial_neighbors = 4;
  EXPECT_EQ(ChooseOnRing(spatial), (Counts{{"spatial", 18 + 17}}));
}

TEST(ChoosePairs, WaysThatCannotWorkSayWhatIsMissing) {
  const auto message = [](const PairChoosing& choosing) {
    return ThrownMessage<ConfigError>([&] { ChooseOnRing(choosing); });
  };
  EXPECT_THAT(message({.ways = "spatial"}), HasSubstr("0 of 20 photographs have GPS"));
  EXPECT_THAT(message({.ways = "sequential", .options = {.order = PhotoOrder::kTime}}),
              HasSubstr("0 of 20 photographs have one in their EXIF"));
}

TEST(ChoosePairs, NewImagesMeanNewPairsOnly) {
  RingDatabase ring(21);
  const PairChoosing choosing{.ways = "retrieval", .options = {.retrieval_neighbors = 2}};
  ring.Choose(choosing);
  const auto before = ring.database.ReadPairChoices();
  ring.AddImage(21);  // Sees what the first one does: it is near that one and both its neighbors.
  EXPECT_EQ(ring.Choose(choosing), (Counts{{"retrieval", 21 + 3}}));
  for (const PairChoiceRecord& choice : ring.database.ReadPairChoices()) {
    const bool is_old = std::find(before.begin(), before.end(), choice) != before.end();
    EXPECT_NE(is_old, PairIdToImagePair(choice.pair_id).second == 22);
  }
  EXPECT_EQ(ring.Choose(choosing), (Counts{{"retrieval", 21 + 3}}));
  // Another way adds its own.
  EXPECT_EQ(ring.Choose({.ways = "sequential", .options = {.overlap = 1}}),
            (Counts{{"retrieval", 21 + 3}, {"sequential", 20}}));
}

// Photographs along a wall, with the real stages.
class ChoosePairsOfPhotosTest : public WallTest {
 protected:
  ChoosePairsOfPhotosTest() : WallTest(0, 20) {
    for (int i = 0; i < 12; ++i) {
      const std::string path = folder_ / ("images/" + Name(i));
      WriteBitmap(path, WallPhoto(160, 120, 20 * i));
      char time[20];
      std::snprintf(time, sizeof(time), "2026:11:22 01:16:%02d", 11 - i);
      WriteExif(path, {.taken_at = time, .gps = GpsPosition{45, 7 + 0.001 * i, 0}});
    }
  }
  BuildPipelineOptions Options(const std::string& database) const {
    BuildPipelineOptions options = WallTest::Options(database);
    options.inputs.depth_path = "";
    options.inputs.pairs = "retrieval";
    options.pair_selection.retrieval_neighbors = 2;
    options.pair_selection.min_shared_points = 20;
    return options;
  }
  // Reasons of pairs in rounds after the first.
  std::map<std::string, int> LaterReasons(const std::string& database) const {
    std::map<std::string, int> reasons;
    for (const auto& choice : Database(folder_ / database).ReadPairChoices()) {
      if (choice.round > 0) ++reasons[choice.reason];
    }
    return reasons;
  }
};

TEST_F(ChoosePairsOfPhotosTest, RoundsFindWhatTheFirstOneMissed) {
  const BuildPipelineReport report = RunBuildPipeline(Options("a.db"));
  EXPECT_EQ(report.summary.largest_component, 12);
  EXPECT_LT(report.summary.num_pairs, 66);
  EXPECT_GE(LaterReasons("a.db")["two_edges"], 5);
  const Database database(folder_ / "a.db");
  EXPECT_EQ(database.ReadPairChoices().size(), database.ReadNumMatches().size());
  EXPECT_TRUE(database.ReadStage(kStagePairs)->is_complete);
  BuildPipelineOptions options = Options("first.db");
  options.pair_selection.max_rounds = 0;
  EXPECT_LT(RunBuildPipeline(options).summary.num_verified, report.summary.num_verified);
  EXPECT_TRUE(LaterReasons("first.db").empty());
  options = Options("strict.db");
  options.pair_selection.min_shared_points = 100000;
  RunBuildPipeline(options);
  EXPECT_EQ(LaterReasons("strict.db")["two_edges"], 0);
}

TEST_F(ChoosePairsOfPhotosTest, DumpsAreEqualForAnyNumberOfThreads) {
  for (const int num_threads : {1, 8}) {
    RunBuildPipeline(Options(std::to_string(num_threads) + ".db"), {.num_threads = num_threads});
  }
  EXPECT_EQ(Dump("1.db"), Dump("8.db"));
}

TEST_F(ChoosePairsOfPhotosTest, InterruptedRunsEndInTheSameDump) {
  RunBuildPipeline(Options("whole.db"));
  const std::string whole = Dump("whole.db");
  int num_stops = 0;
  for (; num_stops < 50; ++num_stops) {
    TestMonitor monitor(30);  // (A run lists and describes twelve photographs each, or nothing.)
    if (!RunBuildPipeline(Options("parts.db"), {.num_threads = 2, .monitor = monitor}).was_stopped)
      break;
  }
  EXPECT_GE(num_stops, 3);
  EXPECT_LT(num_stops, 50);
  EXPECT_EQ(Dump("parts.db"), whole);
  RunBuildPipeline(Options("parts.db"));  // Nothing is left to do.
  EXPECT_EQ(Dump("parts.db"), whole);
}

TEST_F(ChoosePairsOfPhotosTest, PhotographsThatJoinHaveRoundsOfTheirOwn) {
  const std::string last = folder_ / ("images/" + Name(11));
  fs::rename(last, folder_ / "last.jpg");
  RunBuildPipeline(Options("a.db"));
  const auto before = Database(folder_ / "a.db").ReadPairChoices();
  int num_rounds = 0;
  for (const auto& choice : before) num_rounds = std::max(num_rounds, choice.round + 1);
  fs::rename(folder_ / "last.jpg", last);
  const BuildPipelineReport report = RunBuildPipeline(Options("a.db"));
  EXPECT_EQ(report.summary.largest_component, 12);
  std::map<std::string, int> reasons;
  for (const auto& choice : Database(folder_ / "a.db").ReadPairChoices()) {
    if (std::find(before.begin(), before.end(), choice) != before.end()) continue;
    EXPECT_GE(choice.round, num_rounds);
    ++reasons[choice.reason];
    const bool is_of_new = PairIdToImagePair(choice.pair_id).second == 12;
    EXPECT_TRUE(is_of_new || choice.round > num_rounds);
  }
  EXPECT_GE(reasons["retrieval"], 2);
  EXPECT_GE(reasons["two_edges"], 1);
}

TEST_F(ChoosePairsOfPhotosTest, ADamagedGeometryIsLeftOut) {
  const ViewGraphSummary summary = RunBuildPipeline(Options("a.db")).summary;
  RunSql(folder_ / "a.db",
         "UPDATE two_view_geometries SET F = X'0011' WHERE pair_id = (SELECT pair_id FROM "
         "two_view_geometries WHERE rows > 0 LIMIT 1);"
         "UPDATE cairn_stages SET is_complete = 0 WHERE stage = 'pairs'");
  EXPECT_GE(RunBuildPipeline(Options("a.db")).summary.num_pairs, summary.num_pairs);
}

// What a photograph that is gone joined is joined by its neighbors.
TEST_F(ChoosePairsOfPhotosTest, PairsAreChosenAgainWherePhotographsAreDropped) {
  BuildPipelineOptions options = Options("drop.db");
  options.inputs.pairs = "sequential";
  options.pair_selection.overlap = 1;
  options.pair_selection.max_rounds = 0;
  EXPECT_EQ(RunBuildPipeline(options).summary.largest_component, 12);
  fs::remove(folder_ / ("images/" + Name(5)));
  options.inputs.drop_missing = true;
  EXPECT_EQ(RunBuildPipeline(options).summary.largest_component, 11);
}

TEST_F(ChoosePairsOfPhotosTest, PositionsThatChangeInTheirFileAreNoticed) {
  BuildPipelineOptions options = Options("spatial.db");
  options.inputs.pairs = "spatial";
  options.inputs.gps_path = folder_ / "gps.csv";
  options.pair_selection.spatial_neighbors = 1;
  options.pair_selection.spatial_radius_m = 1e5;
  options.pair_selection.max_rounds = 0;
  std::string rows;
  const auto num_pairs_with = [&](int num_rows) {
    rows.clear();
    for (int i = 0; i < num_rows; ++i)
      rows += Name(i) + ",45," + std::to_string(7 + 0.001 * i * i) + "\n";
    WriteFileAtomically(options.inputs.gps_path, rows);
    return RunBuildPipeline(options).summary.num_pairs;
  };
  EXPECT_EQ(num_pairs_with(4), 3);
  EXPECT_EQ(num_pairs_with(12), 11);
  // Where there is nothing to choose, the file has nothing to tell.
  options.inputs.gps_path = "";
  EXPECT_EQ(RunBuildPipeline(options).summary.num_pairs, 11);
  // What joins later needs it, before its features are found.
  WriteBitmap(folder_ / "images/later.jpg", WallPhoto(160, 120, 250));
  options.inputs.gps_path = folder_ / "other.csv";
  WriteFileAtomically(options.inputs.gps_path, "other.jpg,45,7\n");
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("0 of 13 photographs have GPS"));
  EXPECT_EQ(Database(options.inputs.database_path).ReadNumKeypoints().size(), 12u);
}

TEST_F(ChoosePairsOfPhotosTest, TimesAndPlacesComeFromExif) {
  BuildPipelineOptions options = Options("time.db");
  options.inputs.stop_after = BuildStage::kMatching;
  options.inputs.pairs = "sequential,spatial";
  options.pair_selection.order = PhotoOrder::kTime;
  options.pair_selection.overlap = 1;
  options.pair_selection.quadratic_overlap = false;
  options.pair_selection.spatial_neighbors = 4;
  options.pair_selection.spatial_radius_m = 170;  // 78.8 m from one to the next
  WriteExif(folder_ / ("images/" + Name(11)), {.taken_at = "2026:11:22 02:00:00"});
  RunBuildPipeline(options);
  std::map<std::string, int> reasons;
  const Database database(folder_ / "time.db");
  for (const auto& choice : database.ReadPairChoices()) ++reasons[choice.reason];
  // 11, ..., 1, 0 by time, but for the last, which comes after 0; then two apart in space.
  EXPECT_EQ(reasons, (Counts{{"sequential", 11}, {"spatial", 10 + 1}}));
  const auto choices = database.ReadPairChoices();
  EXPECT_EQ(choices[2].pair_id, ImagePairToPairId(1, 12));
  EXPECT_EQ(choices[2].reason, "sequential");
}

TEST_F(ChoosePairsOfPhotosTest, PhotographsThatASequenceOrAPlaceLeavesOutAreCounted) {
  BuildPipelineOptions options = Options("time.db");
  options.inputs.stop_after = BuildStage::kPairs;
  options.inputs.pairs = "sequential,spatial";
  options.pair_selection.order = PhotoOrder::kTime;
  WriteBitmap(folder_ / "images/later.jpg", WallPhoto(160, 120, 250));
  const BuildPipelineReport report = RunBuildPipeline(options);
  EXPECT_THAT(report.run.stages.back().messages,
              ElementsAre(HasSubstr("only 12 of 13 photographs have a time"),
                          HasSubstr("only 12 of 13 photographs have GPS")));
}

TEST_F(ChoosePairsOfPhotosTest, AutoIsAsExhaustiveForASmallCollection) {
  BuildPipelineOptions options = Options("auto.db");
  options.inputs.pairs = "auto";
  RunBuildPipeline(options);
  options = Options("all.db");
  options.inputs.pairs = "exhaustive";
  EXPECT_EQ(RunBuildPipeline(options).summary.num_pairs, 66);
  for (const char* table : {"matches", "two_view_geometries", "cairn_pair_choices",
                            "cairn_pair_metrics", "cairn_camera_lenses"}) {
    const std::string sql = std::string("SELECT * FROM ") + table;
    EXPECT_EQ(RunSql(folder_ / "auto.db", sql), RunSql(folder_ / "all.db", sql)) << table;
  }
}

TEST_F(ChoosePairsOfPhotosTest, PositionsThatNoWayUsesAreAWarning) {
  BuildPipelineOptions options = Options("a.db");
  options.inputs.stop_after = BuildStage::kPairs;
  options.inputs.gps_path = folder_ / "gps.csv";
  WriteFileAtomically(options.inputs.gps_path, "photo0.png,45,7\n");
  for (const std::string pairs : {"exhaustive", "auto"}) {
    options.inputs.pairs = pairs;
    TestMonitor monitor;
    RunBuildPipeline(options, {.monitor = monitor});
    const auto is_it = [](const std::string& text) {
      return text.find("is not used") != text.npos;
    };
    EXPECT_EQ(std::ranges::any_of(monitor.warnings(), is_it), pairs == "exhaustive");
    std::filesystem::remove(options.inputs.database_path);
  }
}

TEST_F(ChoosePairsOfPhotosTest, WaysThatCannotWorkAreToldBeforeFeaturesAreExtracted) {
  BuildPipelineOptions options = Options("spatial.db");
  options.inputs.pairs = "spatial";
  options.inputs.gps_path = folder_ / "gps.csv";
  WriteFileAtomically(options.inputs.gps_path, "other.jpg,45,7\n");
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { RunBuildPipeline(options); }),
              HasSubstr("0 of 12 photographs have GPS"));
  EXPECT_TRUE(Database(options.inputs.database_path).ReadNumKeypoints().empty());
}

}  // namespace
}  // namespace cairn
