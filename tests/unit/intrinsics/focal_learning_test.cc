// Trusted focal lengths that the pairs of their cameras contradict.
#include "cairn/intrinsics/focal_learning.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cairn/pipeline/verify_pairs.h"
#include "cairn/synthetic/scene.h"
#include "support/database_dump.h"
#include "support/temp_folder.h"
#include "support/test_monitor.h"

namespace cairn {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// Pairs of cameras 1 .. n, each with each; those with a wrong camera contradict.
std::vector<CameraPairEvidence> AllPairs(camera_t n, const std::set<camera_t>& wrong) {
  std::vector<CameraPairEvidence> pairs;
  for (camera_t a = 1; a <= n; ++a) {
    for (camera_t b = a + 1; b <= n; ++b) {
      pairs.push_back({a, b, wrong.count(a) + wrong.count(b) > 0});
    }
  }
  return pairs;
}

std::set<camera_t> Refuted(const std::vector<CameraPairEvidence>& pairs) {
  return RejectedCameras(JudgeFocals(pairs));
}

TEST(JudgeFocals, RejectsTheCamerasThatMostOfTheirPairsContradict) {
  EXPECT_EQ(Refuted(AllPairs(8, {})), (std::set<camera_t>{}));
  EXPECT_EQ(Refuted(AllPairs(8, {5})), (std::set<camera_t>{5}));
  EXPECT_EQ(Refuted(AllPairs(9, {2, 5, 7})), (std::set<camera_t>{2, 5, 7}));
  // Odd pairs are no wrong focal lengths.
  auto pairs = AllPairs(8, {});
  for (size_t i = 0; i < pairs.size(); i += 5) pairs[i].is_contradicting = true;
  EXPECT_EQ(Refuted(pairs), (std::set<camera_t>{}));
}

TEST(JudgeFocals, FindsAllCamerasWhereAllAreWrong) {
  EXPECT_EQ(Refuted(AllPairs(5, {1, 2, 3, 4, 5})), (std::set<camera_t>{1, 2, 3, 4, 5}));
  EXPECT_EQ(Refuted(std::vector<CameraPairEvidence>(4, {7, 7, true})), (std::set<camera_t>{7}));
}

// Half of the drawn pairs of the common camera are with one of the wrong ones.
TEST(JudgeFocals, ACommonCameraIsNotAccusedForThoseThatAreWrong) {
  std::vector<CameraPairEvidence> pairs;
  for (camera_t other = 2; other <= 5; ++other) {
    for (int i = 0; i < 4; ++i) {
      pairs.push_back({1, other, true});
      if (i < 3) pairs.push_back({1, 1, false});
    }
  }
  EXPECT_EQ(Refuted(pairs), (std::set<camera_t>{2, 3, 4, 5}));
}

TEST(JudgeFocals, TwoPairsSayNothing) {
  EXPECT_TRUE(JudgeFocals({{1, 2, true}, {1, 3, true}}).empty());
  const auto judged = JudgeFocals({{1, 2, false}, {1, 3, false}, {1, 4, false}});
  ASSERT_EQ(judged.size(), 1u);
  EXPECT_FALSE(judged.at(1).is_rejected);
  EXPECT_EQ(judged.at(1).num_pairs, 3);
}

TEST(JudgeFocals, AClearlySmallerShareContradicts) {
  EXPECT_TRUE(IsContradicting({1, 190, 120, 180}));
  EXPECT_FALSE(IsContradicting({1, 190, 175, 180}));
  EXPECT_FALSE(IsContradicting({1, 40, 20, 35}));  // too few to tell
}

constexpr image_t kWrongImage = 4;
constexpr int kNumImages = 9;

class FocalLearningTest : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return folder_ / name; }

  // Every image has a camera of its own; the focal length of one is `factor` times the true one.
  std::string MakeDatabase(const std::string& name, double factor) const {
    SceneOptions options;
    options.num_images = kNumImages;
    options.num_points = 900;
    options.max_keypoints = 500;
    options.image_noise_px = 0.3;
    options.outlier_ratio = 0.2;
    SyntheticScene scene = MakeScene(options, 3);
    Database database(Path(name));
    WriteScene(scene, SceneContent::kMatches, database);
    Database::Transaction transaction(database);
    for (Image image : scene.images) {
      Camera camera = scene.cameras.at(image.camera_id);
      camera.camera_id = 100 + image.image_id;
      camera.has_prior_focal_length = true;
      if (image.image_id == kWrongImage) camera.SetMeanFocal(factor * camera.MeanFocal());
      database.WriteCamera(camera);
      image.camera_id = camera.camera_id;
      database.WriteImage(image);
    }
    transaction.Commit();
    return Path(name);
  }

  static VerificationReport Verify(const std::string& path, int num_threads = 2,
                                   ProgressMonitor& monitor = NullMonitor()) {
    Database database(path);
    VerificationInput input;
    input.options = "a = 1\n";
    return VerifyPairs(database, MakeVerifiers("fast", {}), input, {},
                       {.num_threads = num_threads, .monitor = monitor});
  }

  testing::TempFolder folder_;
};

TEST_F(FocalLearningTest, RightFocalLengthsStayTrusted) {
  const std::string path = MakeDatabase("a.db", 1.0);
  TestMonitor monitor;
  const VerificationReport report = Verify(path, 2, monitor);
  EXPECT_EQ(report.num_rejected_focals, 0);
  EXPECT_THAT(monitor.warnings(), ::testing::IsEmpty());
  const Database database(path);
  EXPECT_EQ(database.ReadCameraFocals().size(), static_cast<size_t>(kNumImages));
  EXPECT_EQ(RejectedCameras(database.ReadCameraFocals()), (std::set<camera_t>{}));
}

TEST_F(FocalLearningTest, AWrongOneIsNamedAndItsPairsGetFundamentalMatrices) {
  for (const double factor : {0.5, 2.0}) {
    const std::string path = MakeDatabase(std::to_string(factor) + ".db", factor);
    TestMonitor monitor;
    const VerificationReport report = Verify(path, 2, monitor);
    EXPECT_EQ(report.num_rejected_focals, 1);
    EXPECT_EQ(report.stage.status, StageStatus::kWarning);
    EXPECT_THAT(report.stage.messages,
                ElementsAre(AllOf(HasSubstr("camera 104 ("), HasSubstr("prior focal length"))));
    EXPECT_EQ(monitor.warnings(), report.stage.messages);
    const Database database(path);
    // The pairs that were verified twice count once.
    EXPECT_EQ(report.counts.num_pairs, std::ssize(database.ReadMatchedPairIds()));
    EXPECT_EQ(monitor.num_done(), report.counts.num_pairs);
    int num_uncalibrated = 0;
    for (const image_pair_t pair : database.ReadTwoViewGeometryPairIds()) {
      const auto [id1, id2] = PairIdToImagePair(pair);
      const bool is_wrong = id1 == kWrongImage || id2 == kWrongImage;
      const TwoViewConfig config = database.ReadTwoViewGeometry(pair)->config;
      EXPECT_EQ(config == TwoViewConfig::kUncalibrated, is_wrong) << id1 << " " << id2;
      num_uncalibrated += config == TwoViewConfig::kUncalibrated;
    }
    EXPECT_GE(num_uncalibrated, 4);
    // The database's cameras stay as they were.
    for (const Camera& camera : database.ReadCameras()) {
      EXPECT_TRUE(camera.has_prior_focal_length || camera.camera_id < 100);
    }
  }
}

TEST_F(FocalLearningTest, RowsDoNotDependOnThreadsOrInterruptions) {
  const std::string whole = MakeDatabase("1.db", 0.5);
  Verify(whole, 1);
  const std::string dump = DumpDatabase(whole);
  EXPECT_NE(dump.find("\ncairn_camera_focals: 104 1 "), std::string::npos);
  const std::string threads = MakeDatabase("8.db", 0.5);
  Verify(threads, 8);
  EXPECT_TRUE(DumpDatabase(threads) == dump);
  const std::string parts = MakeDatabase("parts.db", 0.5);
  int num_runs = 0, num_refuted = 0;
  for (; num_runs < 40; ++num_runs) {
    TestMonitor monitor(3);
    const VerificationReport report = Verify(parts, 2, monitor);
    num_refuted += report.num_rejected_focals;
    if (!report.stage.WasStopped()) break;
  }
  EXPECT_GT(num_runs, 4);
  EXPECT_EQ(num_refuted, 1);
  EXPECT_TRUE(DumpDatabase(parts) == dump);
}

TEST_F(FocalLearningTest, OnlyTrustedCamerasOfWhichNothingIsKnownAreWeighed) {
  Database database(MakeDatabase("a.db", 1.0));
  const std::vector<image_pair_t> all = database.ReadMatchedPairIds();
  EXPECT_EQ(PairsToWeigh(database, all), all);
  for (camera_t id = 101; id <= 100 + kNumImages; ++id) {
    database.WriteCameraFocal(id, {id == 101, 5, 4});
  }
  EXPECT_TRUE(PairsToWeigh(database, all).empty());

  Database guessed(MakeDatabase("b.db", 1.0));
  Camera camera = guessed.ReadCameras().back();
  camera.has_prior_focal_length = false;
  guessed.WriteCamera(camera);
  const std::vector<image_pair_t> weighed = PairsToWeigh(guessed, all);
  const auto is_of_last = [](image_pair_t pair) {
    return PairIdToImagePair(pair).second == kNumImages;
  };
  EXPECT_EQ(std::ssize(weighed),
            std::ssize(all) - std::count_if(all.begin(), all.end(), is_of_last));
  EXPECT_TRUE(std::none_of(weighed.begin(), weighed.end(), is_of_last));
}

// One camera for all images: its pairs are not all asked for evidence.
TEST_F(FocalLearningTest, ACameraOfManyPairsIsWeighedBySomeOfThem) {
  Database database(MakeDatabase("a.db", 1.0));
  for (Image image : database.ReadImages()) {
    image.camera_id = 101;
    database.WriteImage(image);
  }
  const std::vector<image_pair_t> all = database.ReadMatchedPairIds();
  const std::vector<image_pair_t> weighed = PairsToWeigh(database, all);
  EXPECT_EQ(weighed.size(), 8u);
  EXPECT_TRUE(std::is_sorted(weighed.begin(), weighed.end()));
}

}  // namespace
}  // namespace cairn
