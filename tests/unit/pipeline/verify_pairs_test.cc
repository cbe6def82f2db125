#include "cairn/pipeline/verify_pairs.h"

#include <atomic>
#include <chrono>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "support/database_dump.h"
#include "support/temp_folder.h"
#include "support/test.h"
#include "support/test_monitor.h"

namespace cairn {
namespace {

constexpr int kNumImages = 12;
constexpr int kNumPairs = kNumImages * (kNumImages - 1) / 2;

// A verifier whose result depends on all of its input and on nothing else.
class MockVerifier : public PairVerifier {
 public:
  MockVerifier(uint64_t salt, double share_verified) : salt_(salt), share_(share_verified) {}

  PairReport Verify(const PairInput& input) override {
    ++num_calls;
    Rng rng(input.seed + salt_, "mock", input.pair_id);
    double sum = input.camera1->MeanFocal() + input.camera2->MeanFocal();
    for (const FeatureMatch& match : input.matches) {
      sum += input.keypoints1[match.point1].x + input.keypoints2[match.point2].y;
      if (!input.depth1.empty()) sum += input.depth1[match.point1].depth;
      if (!input.depth2.empty()) sum += input.depth2[match.point2].depth;
    }
    PairReport report;
    report.verifier = "mock_step";
    report.num_iterations = static_cast<int64_t>(salt_);
    if (rng.Uniform() >= share_) {
      report.status = PairStatus::kTooFewInliers;
      report.num_inliers = 3;
      return report;
    }
    report.status = PairStatus::kVerified;
    report.score = rng.Uniform();
    report.residual_px = sum;
    report.geometry.config = TwoViewConfig::kCalibrated;
    report.geometry.cam2_from_cam1 =
        Rigid3d(Eigen::Quaterniond::Identity(), Eigen::Vector3d(rng.Uniform(), 1, 2).normalized());
    report.geometry.inlier_matches = {input.matches.begin(), input.matches.begin() + 15};
    report.num_inliers = 15;
    return report;
  }

  static std::atomic<int> num_calls;

 private:
  uint64_t salt_;
  double share_;
};
std::atomic<int> MockVerifier::num_calls = 0;

std::vector<NamedVerifier> Mocks(double share1 = 0.5, double share2 = 0.5) {
  return {{"first", [share1] { return std::make_unique<MockVerifier>(1, share1); }},
          {"second", [share2] { return std::make_unique<MockVerifier>(2, share2); }}};
}

class PairSchedulerTest : public ::testing::Test {
 protected:
  void SetUp() override { MockVerifier::num_calls = 0; }
  std::string Path(const std::string& name) const { return folder_ / name; }

  // Images 1 .. n; the odd ones have depth; pair (i, j) has 10 + i + j matches.
  std::string MakeDatabase(const std::string& name) {
    Database database(Path(name));
    Database::Transaction transaction(database);
    for (camera_t id = 1; id <= 2; ++id) {
      database.WriteCamera(Camera::FromFocal(id, CameraModel::kPinhole, 100.0 * id, 640, 480));
    }
    for (image_t i = 1; i <= kNumImages; ++i) {
      Rng rng(i);
      database.WriteImage({i, "image" + std::to_string(i), 1 + i % 2});
      std::vector<Keypoint> keypoints(40);
      std::vector<DepthSample> depth(40);
      for (int k = 0; k < 40; ++k) {
        keypoints[k] = {static_cast<float>(rng.Uniform()), static_cast<float>(rng.Uniform())};
        depth[k] = {static_cast<float>(rng.Uniform()), 0, 0, true};
      }
      database.WriteKeypoints(i, keypoints);
      if (i % 2 == 1) database.WriteDepthSamples(i, depth);
      for (image_t j = i + 1; j <= kNumImages; ++j) {
        FeatureMatches matches;
        for (point2D_t k = 0; k < 10 + i + j; ++k) matches.push_back({k, (k * 7) % 40});
        database.WriteMatches(ImagePairToPairId(i, j), matches);
      }
    }
    transaction.Commit();
    return Path(name);
  }

  static StageReport Verify(const std::string& path, int num_threads = 2,
                            ProgressMonitor& monitor = NullMonitor(),
                            VerificationInput input = Input(), uint64_t seed = 3) {
    Database database(path);
    input.scheduler.max_memory_gib = 1e-5;  // About 10 KB: a tile has few images.
    return VerifyPairs(database, Mocks(), input, {seed, num_threads, monitor});
  }

  static VerificationInput Input() {
    VerificationInput input;
    input.options = "a = 1\n";
    return input;
  }

  TempFolder folder_;
};

// Pairs (i, j) with i + j < 10 have fewer than 20 matches.
int NumTooFew() {
  int num = 0;
  for (int i = 1; i <= kNumImages; ++i) {
    for (int j = i + 1; j <= kNumImages; ++j) num += 10 + i + j < 20;
  }
  return num;
}

TEST_F(PairSchedulerTest, EveryPairGetsItsRows) {
  const std::string path = MakeDatabase("a.db");
  const StageReport report = Verify(path);
  EXPECT_EQ(report.status, StageStatus::kOk);
  EXPECT_EQ(report.Value("pairs"), kNumPairs);
  EXPECT_EQ(report.Value("tried"), kNumPairs - NumTooFew());
  EXPECT_EQ(MockVerifier::num_calls, 2 * (kNumPairs - NumTooFew()));
  const Database database(path);
  EXPECT_EQ(database.ReadNumInliers().size(), static_cast<size_t>(kNumPairs));
  EXPECT_EQ(database.ReadPairMetrics().size(), 2u * (kNumPairs - NumTooFew()));
  EXPECT_EQ(static_cast<int64_t>(database.ReadTwoViewGeometryPairIds().size()),
            report.Value("verified"));
  for (const auto& [verifier, num] : database.CountWinners()) {
    EXPECT_EQ(report.Value("verified_by_" + verifier), num);
    EXPECT_GT(num, 5);
  }
  EXPECT_EQ(report.Value("rejected_too_few_matches"), NumTooFew());
  EXPECT_GT(report.Value("rejected_too_few_inliers"), 5);
  EXPECT_TRUE(database.ReadStage("verification")->is_complete);
}

TEST_F(PairSchedulerTest, TheVerifierWithTheLargerScoreWins) {
  const std::string path = MakeDatabase("a.db");
  Verify(path);
  const Database database(path);
  const std::vector<PairMetrics> all_metrics = database.ReadPairMetrics();
  int num_contested = 0;
  for (const image_pair_t pair : database.ReadTwoViewGeometryPairIds()) {
    std::vector<PairMetrics> metrics = all_metrics;
    std::erase_if(metrics, [pair](const PairMetrics& m) { return m.pair_id != pair; });
    ASSERT_EQ(metrics.size(), 2u);
    EXPECT_EQ(metrics[0].is_winner + metrics[1].is_winner, 1);
    const PairMetrics& winner = metrics[metrics[1].is_winner];
    const PairMetrics& loser = metrics[!metrics[1].is_winner];
    EXPECT_EQ(winner.status, "verified");
    EXPECT_EQ(winner.step, "mock_step");
    EXPECT_EQ(winner.num_inliers, 15);
    EXPECT_GE(winner.num_matches, 20);
    if (loser.status == "verified") {
      ++num_contested;
      EXPECT_GT(winner.score, loser.score);
    } else {
      EXPECT_FALSE(loser.cam2_from_cam1);
    }
    const TwoViewGeometry geometry = *database.ReadTwoViewGeometry(pair);
    EXPECT_EQ(geometry.cam2_from_cam1->translation, winner.cam2_from_cam1->translation);
    EXPECT_TRUE(database.ReadTiming("verification", pair, "first"));
  }
  EXPECT_GT(num_contested, 3);
}

TEST_F(PairSchedulerTest, DumpsDoNotDependOnTheNumberOfThreads) {
  Verify(MakeDatabase("1.db"), 1);
  Verify(MakeDatabase("2.db"), 2);
  Verify(MakeDatabase("8.db"), 8);
  const std::string dump = DumpDatabase(Path("1.db"));
  EXPECT_EQ(DumpDatabase(Path("2.db")), dump);
  EXPECT_EQ(DumpDatabase(Path("8.db")), dump);
}

TEST_F(PairSchedulerTest, AnInterruptedRunContinuesToTheSameDump) {
  Verify(MakeDatabase("whole.db"));
  const std::string path = MakeDatabase("parts.db");
  int num_runs = 0;
  for (; num_runs < 100; ++num_runs) {
    TestMonitor monitor(9);
    const StageReport report = Verify(path, 2, monitor);
    if (!report.WasStopped()) break;
    EXPECT_FALSE(Database(path).ReadStage("verification")->is_complete);
  }
  EXPECT_GT(num_runs, 4);
  EXPECT_LT(num_runs, 10);
  EXPECT_EQ(DumpDatabase(path), DumpDatabase(Path("whole.db")));
}

TEST_F(PairSchedulerTest, NothingIsDoneTwice) {
  const std::string path = MakeDatabase("a.db");
  Verify(path);
  const std::string dump = DumpDatabase(path);
  MockVerifier::num_calls = 0;
  EXPECT_EQ(Verify(path).Value("pairs"), 0);
  EXPECT_EQ(MockVerifier::num_calls, 0);
  EXPECT_EQ(DumpDatabase(path), dump);
}

TEST_F(PairSchedulerTest, NewPairsJoin) {
  const std::string path = MakeDatabase("a.db");
  Verify(path);
  {
    Database database(path);
    database.WriteImage({20, "new", 1});
    database.WriteKeypoints(20, std::vector<Keypoint>(40));
    FeatureMatches matches;
    for (point2D_t k = 0; k < 30; ++k) matches.push_back({k, k});
    database.WriteMatches(ImagePairToPairId(3, 20), matches);
  }
  MockVerifier::num_calls = 0;
  EXPECT_EQ(Verify(path).Value("pairs"), 1);
  EXPECT_EQ(MockVerifier::num_calls, 2);
}

TEST_F(PairSchedulerTest, ChangedInputsAreNoticed) {
  const auto message = [&](const std::string& name, const std::function<void(Database&)>& change) {
    const std::string path = MakeDatabase(name);
    Verify(path);
    {
      Database database(path);
      change(database);
    }
    try {
      Verify(path);
    } catch (const ConfigError& error) {
      return std::string(error.what());
    }
    return std::string("not noticed");
  };
  const std::string expected = "changed since the stage 'verification' was computed";
  EXPECT_THAT(message("keypoints.db",
                      [](Database& db) { db.WriteKeypoints(6, std::vector<Keypoint>(40)); }),
              HasSubstr(expected));
  EXPECT_THAT(message("depth.db",
                      [](Database& db) { db.WriteDepthSamples(6, std::vector<DepthSample>(40)); }),
              HasSubstr(expected));
  EXPECT_THAT(message("camera.db",
                      [](Database& db) {
                        Camera camera = db.ReadCameras()[0];
                        camera.params[0] += 1;
                        db.WriteCamera(camera);
                      }),
              HasSubstr(expected));
  EXPECT_THAT(message("matches.db",
                      [](Database& db) {
                        db.WriteMatches(ImagePairToPairId(4, 5), {{0, 0}});
                      }),
              HasSubstr("image4 and image5 changed"));
}

TEST_F(PairSchedulerTest, PairsVerifiedByAnotherProgramAreLeftAlone) {
  const std::string path = MakeDatabase("a.db");
  const image_pair_t pair = ImagePairToPairId(8, 9);
  {
    Database database(path);
    TwoViewGeometry geometry;
    geometry.config = TwoViewConfig::kPlanar;
    geometry.inlier_matches = {{1, 1}};
    database.WriteTwoViewGeometry(ImagePairToPairId(9, 10), geometry);  // it tells nothing
    geometry.H = Eigen::Matrix3d::Identity();
    database.WriteTwoViewGeometry(pair, geometry);
  }
  EXPECT_EQ(Verify(path).Value("pairs"), kNumPairs - 1);
  const Database database(path);
  EXPECT_EQ(database.ReadTwoViewGeometry(pair)->config, TwoViewConfig::kPlanar);
  for (const PairMetrics& metrics : database.ReadPairMetrics()) EXPECT_NE(metrics.pair_id, pair);
}

TEST_F(PairSchedulerTest, OnlyTheGivenPairsAreVerified) {
  const std::string path = MakeDatabase("a.db");
  VerificationInput input = Input();
  input.pairs = {ImagePairToPairId(8, 9), ImagePairToPairId(9, 10)};
  EXPECT_EQ(Verify(path, 2, NullMonitor(), input).Value("pairs"), 2);
  EXPECT_EQ(Verify(path).Value("pairs"), kNumPairs - 2);
}

TEST_F(PairSchedulerTest, SeedAndMinNumMatchesMatter) {
  VerificationInput input = Input();
  Verify(MakeDatabase("a.db"));
  Verify(MakeDatabase("b.db"), 2, NullMonitor(), input, 4);
  EXPECT_NE(DumpDatabase(Path("a.db")), DumpDatabase(Path("b.db")));
  input.min_num_matches = 1000;
  EXPECT_EQ(Verify(MakeDatabase("c.db"), 2, NullMonitor(), input).Value("tried"), 0);
}

TEST_F(PairSchedulerTest, DamagedRowsAreNamedAndTheRestGoesOn) {
  const std::string path = MakeDatabase("a.db");
  {
    Database database(path);
    database.WriteDepthSamples(9, std::vector<DepthSample>(5));
    database.WriteMatches(ImagePairToPairId(10, 100), FeatureMatches(30));
    database.WriteMatches(ImagePairToPairId(11, 12), FeatureMatches(30, {39, 40}));
  }
  RunSql(path, "UPDATE keypoints SET rows = 41 WHERE image_id = 8");
  RunSql(path, "UPDATE matches SET rows = 1 WHERE pair_id = " +
                   std::to_string(ImagePairToPairId(10, 11)));
  TestMonitor monitor;
  const StageReport report = Verify(path, 2, monitor);
  EXPECT_EQ(report.status, StageStatus::kWarning);
  EXPECT_THAT(monitor.warnings(),
              UnorderedElementsAre(
                  HasSubstr("keypoints of image 8: 41 x 6 values need 984 bytes"),
                  HasSubstr("40 keypoints of image9, but 5 depth samples; its depth is not used"),
                  AllOf(HasSubstr("(images 10, 11): 1 x 2 values"),
                        HasSubstr("the pair of image10 and image11 is left out")),
                  HasSubstr("matches of image11 and image12 refer to keypoints"),
                  AllOf(HasSubstr("2 pairs are left out; for example, matches of pair"),
                        HasSubstr("(images 10, 11): 1 x 2 values"))));
  EXPECT_EQ(report.warnings.size(), 1u);
  // All pairs of image 8 that are tried, and two others.
  const int num_left_out = 10 + 2;
  EXPECT_EQ(report.Value("pairs"), kNumPairs - num_left_out);
  EXPECT_EQ(Database(path).ReadNumInliers().size(), static_cast<size_t>(kNumPairs - num_left_out));
  // Repaired, they join.
  RunSql(path, "UPDATE keypoints SET rows = 40 WHERE image_id = 8");
  EXPECT_EQ(Verify(path).Value("pairs"), 10);
}

TEST_F(PairSchedulerTest, AVerifierThatThrowsEndsTheRunAndKeepsTheDatabaseUsable) {
  const std::string path = MakeDatabase("a.db");
  class Throwing : public PairVerifier {
   public:
    PairReport Verify(const PairInput&) override { throw BugError("broken verifier"); }
  };
  Database database(path);
  EXPECT_THROW(VerifyPairs(database, {{"bad", [] { return std::make_unique<Throwing>(); }}},
                           Input(), {.num_threads = 2}),
               BugError);
  EXPECT_EQ(Verify(path).Value("pairs"), kNumPairs);
}

// Verifies nothing, but lets threads go on in twos, at the same moment or a little after each
// other: whatever they then do to one value without a lock, they do to it together.
class MeetingVerifier : public PairVerifier {
 public:
  PairReport Verify(const PairInput&) override {
    const int ticket = num_arrived++;
    const auto start = std::chrono::steady_clock::now();
    // The last pair of a round waits alone.
    while (ticket % 2 == 0 && num_arrived <= ticket + 1 &&
           std::chrono::steady_clock::now() - start < std::chrono::milliseconds(2)) {
    }
    for (int reads = ticket % 2 == 1 ? ticket % 256 : 0; reads > 0; --reads) num_arrived.load();
    PairReport report;
    report.status = ticket % 3 == 0 ? PairStatus::kTooFewInliers : PairStatus::kNoModel;
    return report;
  }

  static std::atomic<int> num_arrived;
};
std::atomic<int> MeetingVerifier::num_arrived = 0;

TEST_F(PairSchedulerTest, CountsAreExactWhereThreadsFinishTogether) {
  constexpr image_t kNumMany = 100;
  constexpr int kNumManyPairs = kNumMany * (kNumMany - 1) / 2;
  Database database(Path("many.db"));
  {
    Database::Transaction transaction(database);
    database.WriteCamera(Camera::FromFocal(1, CameraModel::kPinhole, 100, 640, 480));
    for (image_t i = 1; i <= kNumMany; ++i) {
      database.WriteImage({i, "image" + std::to_string(i), 1});
      database.WriteKeypoints(i, std::vector<Keypoint>(2));
      for (image_t j = i + 1; j <= kNumMany; ++j) {
        database.WriteMatches(ImagePairToPairId(i, j), {{0, 0}, {1, 1}});
      }
    }
    transaction.Commit();
  }
  MeetingVerifier::num_arrived = 0;
  VerificationInput input = Input();
  input.min_num_matches = 1;
  const StageReport report =
      VerifyPairs(database, {{"meeting", [] { return std::make_unique<MeetingVerifier>(); }}},
                  input, {.num_threads = 2});
  EXPECT_EQ(MeetingVerifier::num_arrived, kNumManyPairs);
  EXPECT_EQ(report.Value("pairs"), kNumManyPairs);
  EXPECT_EQ(report.Value("tried"), kNumManyPairs);
  EXPECT_EQ(report.Value("rejected_too_few_inliers") + report.Value("rejected_no_model"),
            kNumManyPairs);
}

TEST_F(PairSchedulerTest, TheMonitorSeesEveryPairOnce) {
  TestMonitor monitor;
  Verify(MakeDatabase("a.db"), 2, monitor);
  EXPECT_EQ(monitor.num_done(), kNumPairs);
  EXPECT_EQ(monitor.totals(), std::vector<int64_t>{kNumPairs});
}

}  // namespace
}  // namespace cairn
