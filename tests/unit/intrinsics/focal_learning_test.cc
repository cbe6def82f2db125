// Trusted focal lengths that the pairs of their cameras contradict.
#include "intrinsics/focal_learning.h"

#include "cairn/synthetic/scene.h"
#include "support/test.h"
#include "unit/intrinsics/learning_fixture.h"

namespace cairn {
namespace {

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

std::set<camera_t> Rejected(const std::vector<CameraPairEvidence>& pairs) {
  return RejectedCameras(JudgeFocals(pairs));
}

TEST(JudgeFocals, RejectsTheCamerasThatMostOfTheirPairsContradict) {
  EXPECT_EQ(Rejected(AllPairs(8, {})), (std::set<camera_t>{}));
  EXPECT_EQ(Rejected(AllPairs(8, {5})), (std::set<camera_t>{5}));
  EXPECT_EQ(Rejected(AllPairs(9, {2, 5, 7})), (std::set<camera_t>{2, 5, 7}));
  // Odd pairs are no wrong focal lengths.
  auto pairs = AllPairs(8, {});
  for (size_t i = 0; i < pairs.size(); i += 5) pairs[i].is_contradicting = true;
  EXPECT_EQ(Rejected(pairs), (std::set<camera_t>{}));
}

TEST(JudgeFocals, FindsAllCamerasWhereAllAreWrong) {
  EXPECT_EQ(Rejected(AllPairs(5, {1, 2, 3, 4, 5})), (std::set<camera_t>{1, 2, 3, 4, 5}));
  EXPECT_EQ(Rejected(std::vector<CameraPairEvidence>(4, {7, 7, true})), (std::set<camera_t>{7}));
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
  EXPECT_EQ(Rejected(pairs), (std::set<camera_t>{2, 3, 4, 5}));
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

class FocalLearningTest : public LearningTest {
 protected:
  // Every image has a camera of its own; the focal length of one is `factor` times the true one.
  std::string MakeDatabase(const std::string& name, double factor) const {
    SceneOptions options;
    options.num_images = kNumImages;
    options.num_points = 900;
    options.max_keypoints = 500;
    options.image_noise_px = 0.3;
    options.outlier_ratio = 0.2;
    SyntheticScene scene = MakeScene(options, 3);
    const std::string path = folder_ / name;
    Database database(path);
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
    return path;
  }
};

TEST_F(FocalLearningTest, RightFocalLengthsStayTrusted) {
  const std::string path = MakeDatabase("a.db", 1.0);
  TestMonitor monitor;
  const StageReport report = Verify(path, 2, monitor);
  EXPECT_EQ(report.Value("rejected_focals"), 0);
  EXPECT_THAT(monitor.warnings(), IsEmpty());
  const Database database(path);
  EXPECT_EQ(database.ReadCameraFocals().size(), static_cast<size_t>(kNumImages));
  EXPECT_EQ(RejectedCameras(database.ReadCameraFocals()), (std::set<camera_t>{}));
}

TEST_F(FocalLearningTest, AWrongOneIsNamedAndItsPairsGetFundamentalMatrices) {
  for (const double factor : {0.5, 2.0}) {
    const std::string path = MakeDatabase(std::to_string(factor) + ".db", factor);
    TestMonitor monitor;
    const StageReport report = Verify(path, 2, monitor);
    EXPECT_EQ(report.Value("rejected_focals"), 1);
    EXPECT_EQ(report.status, StageStatus::kWarning);
    EXPECT_THAT(report.messages,
                ElementsAre(AllOf(HasSubstr("camera 104 ("), HasSubstr("prior focal length"))));
    EXPECT_EQ(monitor.warnings(), report.messages);
    const Database database(path);
    // The pairs that were verified twice count once.
    EXPECT_EQ(report.Value("pairs"), std::ssize(database.ReadMatchedPairIds()));
    EXPECT_EQ(monitor.num_done(), report.Value("pairs"));
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
  const std::string rows = ExpectEqualRows(
      [&](const std::string& name) { return MakeDatabase(name, 0.5); }, "rejected_focals", 1);
  EXPECT_NE(rows.find("\ncairn_camera_focals: 104 1 "), std::string::npos);
}

// Photographs come and go: the last one comes later, and a verdict is left that only photographs
// which are gone can have given, for a camera whose prior is right.
TEST_F(FocalLearningTest, VerdictsAreThoseOfThePhotographsOfToday) {
  for (const double factor : {1.0, 0.5}) {
    const std::string name = std::to_string(factor);
    const std::string fresh = MakeDatabase(name + "_fresh.db", factor);
    Verify(fresh);
    const std::string grown = MakeDatabase(name + "_grown.db", factor);
    {
      Database all(fresh), database(grown);
      const std::vector<Image> images = database.ReadImages();
      const image_t last = images.back().image_id;
      std::map<image_pair_t, FeatureMatches> matches;
      for (const image_pair_t pair : database.ReadMatchedPairIds()) {
        if (PairIdToImagePair(pair).second == last) matches[pair] = *database.ReadMatches(pair);
      }
      ASSERT_GE(matches.size(), 4u);
      database.DeleteImagesAndPairs({last});
      database.WriteCameraFocals({{101, {true, 5, 5}}});
      Verify(grown);
      EXPECT_FALSE(RejectedCameras(database.ReadCameraFocals()).contains(101));
      for (const Camera& camera : all.ReadCameras()) database.WriteCamera(camera);
      database.WriteImage(images.back());
      database.WriteKeypoints(last, *all.ReadKeypoints(last));
      database.WriteDescriptors(last, *all.ReadDescriptors(last));
      database.WriteDepthSamples(last, *all.ReadDepthSamples(last));
      for (const auto& [pair, of_pair] : matches) database.WriteMatches(pair, of_pair);
      EXPECT_NE(DumpDatabase(grown), DumpDatabase(fresh));
    }
    Verify(grown);
    EXPECT_TRUE(DumpDatabase(grown) == DumpDatabase(fresh)) << factor;
  }
}

// A database of pairs that were verified before anything was weighed, or by a cairn that did not
// keep the evidence of rejected cameras.
TEST_F(FocalLearningTest, MissingEvidenceIsCollected) {
  const std::string path = MakeDatabase("a.db", 0.5);
  Verify(path);
  const std::string rows = DumpDatabase(path);
  {
    Database database(path);
    for (const PairFocalEvidence& pair : database.ReadFocalEvidence()) {
      database.DeleteFocalEvidence(pair.pair_id);
    }
  }
  TestMonitor monitor;
  EXPECT_EQ(Verify(path, 2, monitor).Value("rejected_focals"), 0);  // It was before.
  EXPECT_EQ(monitor.num_done(), 0);
  EXPECT_TRUE(DumpDatabase(path) == rows);
}

TEST_F(FocalLearningTest, CamerasWithAPriorAreWeighedWhateverWasFoundBefore) {
  Database database(MakeDatabase("a.db", 1.0));
  const std::vector<image_pair_t> all = database.ReadMatchedPairIds();
  EXPECT_EQ(PairsToWeigh(database, all), all);
  database.WriteCameraFocals({{101, {true, 5, 4}}, {102, {false, 5, 1}}});
  EXPECT_EQ(PairsToWeigh(database, all), all);

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
