// Features, depth and matching, each alone.

#include "cairn/pipeline/stages.h"

#include <filesystem>
#include <fstream>

#include "cairn/base/error.h"
#include "database/stage_names.h"
#include "pipeline/pairs/exhaustive.h"
#include "pipeline/stages/masks.h"
#include "pipeline/stages/stage_ledger.h"
#include "support/database_dump.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "support/thrown_message.h"
#include "unit/pipeline/wall_fixture.h"

namespace cairn {
namespace {
namespace fs = std::filesystem;

constexpr int kWidth = 160;
constexpr int kHeight = 120;

FeatureOptions FastFeatures() {
  FeatureOptions options;
  options.type = FeatureType::kSift;
  options.first_octave = 0;
  return options;
}

class StagesTest : public WallTest {
 protected:
  StagesTest() : WallTest(4, 10, /*with_depth=*/false) {}
  static std::string Name(int i) { return "photo" + std::to_string(i) + ".png"; }
  void AddDepth(int i, float depth = 2) {
    WriteNpy(depth_ + "/" + Name(i) + ".npy", 16, 12, std::vector<float>(16 * 12, depth));
  }
  // Black left of column x.
  static Bitmap Mask(int x) {
    Bitmap mask{kWidth, kHeight, 1, {}};
    for (int i = 0; i < kWidth * kHeight; ++i) mask.data.push_back(i % kWidth < x ? 0 : 255);
    return mask;
  }
  void AddMask(int i, int x) {
    fs::create_directories(masks_);
    WriteBitmap(masks_ + "/" + Name(i) + ".png", Mask(x));
  }
  StageReport Extract(ProgressMonitor& monitor = NullMonitor()) {
    ImportPhotos(database_, {images_}, {}, {.num_threads = 2});
    return ExtractImageFeatures(database_, {images_, masks_}, FastFeatures(),
                                {.num_threads = 2, .monitor = monitor});
  }
  StageReport Depth(ProgressMonitor& monitor = NullMonitor(), const DepthOptions& options = {}) {
    return SampleImageDepth(database_, images_, {depth_, ""}, options,
                            {.num_threads = 2, .monitor = monitor});
  }
  // Those of --pairs exhaustive.
  static std::vector<image_pair_t> AllPairs(Database& database) {
    return ExhaustivePairs(database.ReadNumDescriptors(), MatchOrigins(database));
  }
  StageReport Match(const std::vector<image_pair_t>& pairs) {
    return MatchImagePairs(database_, {pairs}, {}, {.num_threads = 2});
  }
  StageReport Match() { return Match(AllPairs(database_)); }
  const std::string images_ = Images();
  const std::string depth_ = folder_ / "depth";
  std::string masks_;  // none
  Database database_{folder_ / "scene.db"};
};

TEST_F(StagesTest, FeaturesAreThoseOfTheExtractor) {
  const StageReport report = Extract();
  EXPECT_EQ(report.status, StageStatus::kOk);
  const Features features = ExtractFeatures(WallPhoto(kWidth, kHeight, 10), FastFeatures());
  EXPECT_GT(features.keypoints.size(), 50u);
  EXPECT_EQ(*database_.ReadKeypoints(2), features.keypoints);
  EXPECT_EQ(*database_.ReadDescriptors(2), features.descriptors);
  EXPECT_TRUE(database_.ReadStage("features")->is_complete);
}

TEST_F(StagesTest, FeaturesThatAreThereAreNotComputed) {
  database_.WriteCamera(Camera::FromFocal(1, CameraModel::kPinhole, 100, kWidth, kHeight));
  database_.WriteImage({1, Name(2), 1});
  database_.WriteKeypoints(1, std::vector<Keypoint>(7));
  Extract();
  EXPECT_EQ(database_.ReadKeypoints(1)->size(), 7u);
  EXPECT_EQ(database_.ReadNumKeypoints().size(), 4u);
  TestMonitor monitor;
  Extract(monitor);
  EXPECT_EQ(monitor.num_done(), 0);
}

TEST_F(StagesTest, ATruncatedPhotographLeavesTheDatabaseAndTheRestGoesOn) {
  const auto size = fs::file_size(images_ + "/" + Name(1));
  fs::resize_file(images_ + "/" + Name(1), size / 2);
  TestMonitor monitor;
  const StageReport report = Extract(monitor);
  EXPECT_EQ(report.status, StageStatus::kWarning);
  EXPECT_THAT(monitor.warnings(), ElementsAre(HasSubstr(Name(1) + ": ")));
  EXPECT_EQ(database_.ReadImages().size(), 3u);
  EXPECT_EQ(database_.ReadCameras().size(), 3u);
  EXPECT_EQ(database_.ReadNumKeypoints().size(), 3u);
  EXPECT_EQ(database_.ForgetLostRows(true).num_images, 0);  // no other program deleted it
  // Repaired, it joins.
  AddPhoto(1);
  EXPECT_EQ(Extract().status, StageStatus::kOk);
  EXPECT_EQ(database_.ReadNumKeypoints().size(), 4u);
}

TEST_F(StagesTest, APhotographThatIsGoneWhenItsFeaturesAreMadeIsTriedAgain) {
  ImportPhotos(database_, {images_}, {}, {.num_threads = 2});
  std::filesystem::remove(images_ + "/" + Name(1));
  TestMonitor monitor;
  ExtractImageFeatures(database_, {images_}, FastFeatures(),
                       {.num_threads = 2, .monitor = monitor});
  EXPECT_THAT(monitor.warnings(), ElementsAre(Name(1) + ": No such file or directory; skipped"));
  AddPhoto(1);
  EXPECT_EQ(Extract().status, StageStatus::kOk);
  EXPECT_EQ(database_.ReadNumKeypoints().size(), 4u);
}

TEST_F(StagesTest, APhotographThatDoesNotFitItsGivenCameraIsSkipped) {
  database_.WriteCamera(Camera::FromFocal(1, CameraModel::kPinhole, 100, 10, 10));
  database_.WriteImage({1, Name(0), 1});
  TestMonitor monitor;
  Extract(monitor);
  EXPECT_THAT(monitor.warnings(),
              ElementsAre(Name(0) + ": is 160 x 120 pixels, its camera 10 x 10; skipped"));
  EXPECT_EQ(database_.ReadImages().size(), 4u);  // It is not ours to remove.
}

TEST_F(StagesTest, AStoppedStageCountsWhatItComputed) {
  ImportPhotos(database_, {images_});
  TestMonitor features_monitor(1), depth_monitor(1), matching_monitor(1);
  const StageReport features = ExtractImageFeatures(
      database_, {images_}, FastFeatures(), {.num_threads = 1, .monitor = features_monitor});
  EXPECT_EQ(features.Value("computed"), 1);
  EXPECT_EQ(database_.ReadNumKeypoints().size(), 1u);
  Extract();
  for (int i = 0; i < 4; ++i) AddDepth(i);
  const StageReport depth = SampleImageDepth(database_, images_, {depth_, ""}, {},
                                             {.num_threads = 1, .monitor = depth_monitor});
  EXPECT_EQ(depth.Value("computed"), 1);
  EXPECT_EQ(database_.ReadNumDepthSamples().size(), 1u);
  const StageReport matching = MatchImagePairs(database_, {AllPairs(database_)}, {},
                                               {.num_threads = 1, .monitor = matching_monitor});
  EXPECT_EQ(matching.Value("computed"), 1);
  EXPECT_EQ(database_.ReadNumMatches().size(), 1u);
}

TEST_F(StagesTest, WithoutImagePathNothingIsExtracted) {
  ImportPhotos(database_, {images_}, {}, {.num_threads = 2});
  const StageReport report =
      ExtractImageFeatures(database_, {""}, FastFeatures(), {.num_threads = 2});
  EXPECT_EQ(report.status, StageStatus::kOk);
  EXPECT_TRUE(database_.ReadNumKeypoints().empty());
}

// 192 million pixels took 460 MB, of which those of the reduced image are a third.
TEST(ExtractionBytes, CountsTheWholePhotographOfWhichFeaturesAreReduced) {
  EXPECT_GT(ExtractionBytes({16000, 12000}, {.first_octave = 0}), 460'000'000);
  EXPECT_LT(ExtractionBytes({3200, 2400}, {.first_octave = 0}), 460'000'000);
}

TEST_F(StagesTest, NoFeaturesWhereTheMaskIsBlack) {
  masks_ = folder_ / "masks";
  AddMask(1, kWidth / 2);
  TestMonitor monitor;
  EXPECT_EQ(Extract(monitor).status, StageStatus::kWarning);
  EXPECT_THAT(monitor.warnings(),
              ElementsAre("no mask of 3 images, such as photo0.png; features are found everywhere "
                          "in them"));
  const Bitmap mask = Mask(kWidth / 2), photo = WallPhoto(kWidth, kHeight, 10);
  const Features features = ExtractFeatures(photo, FastFeatures(), &mask);
  EXPECT_EQ(*database_.ReadKeypoints(2), features.keypoints);
  EXPECT_GT(features.keypoints.size(), 20u);
  for (const Keypoint& keypoint : features.keypoints) EXPECT_GE(keypoint.x, kWidth / 2);
  // Those that stay are those of the whole photograph.
  EXPECT_EQ(database_.ReadKeypoints(1)->size(),
            ExtractFeatures(WallPhoto(kWidth, kHeight, 0), FastFeatures()).keypoints.size());
}

// As a database that was made with the masks at once.
TEST_F(StagesTest, AChangedMaskRecomputesItsImageAndPairs) {
  masks_ = folder_ / "masks";
  for (int i = 0; i < 4; ++i) AddMask(i, 60);
  Extract();
  Match();
  AddMask(1, 40);
  const auto other = *database_.ReadKeypoints(1);
  TestMonitor monitor;
  Extract(monitor);
  EXPECT_EQ(monitor.num_done(), 1);
  EXPECT_EQ(*database_.ReadKeypoints(1), other);
  EXPECT_EQ(database_.ReadNumMatches().size(), 3u);  // those without image 2
  Match();
  Database fresh(folder_ / "fresh.db");
  ImportPhotos(fresh, {images_}, {}, {.num_threads = 2});
  ExtractImageFeatures(fresh, {images_, masks_}, FastFeatures(), {.num_threads = 2});
  MatchImagePairs(fresh, {AllPairs(fresh)}, {}, {.num_threads = 2});
  EXPECT_EQ(DumpDatabase(folder_ / "scene.db"), DumpDatabase(folder_ / "fresh.db"));
  TestMonitor again;
  Extract(again);
  EXPECT_EQ(again.num_done(), 0);
}

TEST_F(StagesTest, MasksThatComeLaterRecomputeTheirImages) {
  Extract();
  masks_ = folder_ / "masks";
  AddMask(2, 60);
  TestMonitor monitor;
  Extract(monitor);
  EXPECT_EQ(monitor.num_done(), 1);
  const std::vector<Keypoint> keypoints = *database_.ReadKeypoints(3);
  for (const Keypoint& keypoint : keypoints) EXPECT_GE(keypoint.x, 60);
}

TEST_F(StagesTest, AnImageThatIsNotInTheFolderHasNoMask) {
  Extract();
  database_.WriteImage({9, "../a.png", 1});
  database_.WriteKeypoints(9, {});
  masks_ = folder_ / "masks";
  AddMask(1, 0);
  TestMonitor monitor;
  Extract(monitor);
  EXPECT_THAT(monitor.warnings(), ElementsAre(HasSubstr("no mask of 4 images")));
}

TEST_F(StagesTest, AMaskOfAnotherSizeEndsTheStage) {
  masks_ = folder_ / "masks";
  fs::create_directories(masks_);
  WriteBitmap(masks_ + "/" + Name(3) + ".png", Bitmap{20, 10, 1, std::vector<uint8_t>(200)});
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { Extract(); }),
              HasSubstr("photo3.png.png is 20 x 10 pixels, its photograph 160 x 120"));
  EXPECT_EQ(database_.ReadImages().size(), 4u);
}

TEST_F(StagesTest, DepthIsSampledAtTheKeypoints) {
  Extract();
  for (int i = 0; i < 4; ++i) AddDepth(i, 2.0f + i);
  EXPECT_EQ(Depth().status, StageStatus::kOk);
  const std::vector<DepthSample> samples = *database_.ReadDepthSamples(3);
  ASSERT_EQ(samples.size(), database_.ReadKeypoints(3)->size());
  for (const DepthSample& sample : samples) {
    EXPECT_TRUE(sample.is_valid);
    EXPECT_NEAR(sample.depth, 4, 1e-4);
    EXPECT_NEAR(sample.ddepth_dx, 0, 1e-4);
  }
}

TEST_F(StagesTest, AnImageWithoutADepthMapIsNamedOnceAndGetsItLater) {
  Extract();
  for (int i = 0; i < 3; ++i) AddDepth(i);
  std::ofstream(depth_ + "/" + Name(2) + ".npy") << "broken";
  TestMonitor monitor;
  EXPECT_EQ(Depth(monitor).status, StageStatus::kWarning);
  EXPECT_THAT(monitor.warnings(),
              ElementsAre(HasSubstr(depth_ + "/" + Name(2) + ".npy: not a .npy file"),
                          AllOf(HasSubstr(Name(3) + ": no depth map in " + depth_),
                                HasSubstr("; it has no depth")),
                          "no depth for 2 photos"));
  EXPECT_EQ(database_.ReadNumDepthSamples().size(), 2u);
  TestMonitor again;
  Depth(again);
  EXPECT_EQ(again.num_done(), 0);
  AddDepth(2);
  AddDepth(3);
  Depth();
  EXPECT_EQ(database_.ReadNumDepthSamples().size(), 4u);
}

// A map of 12 x 16 values for a photograph that is as wide as 16 to 12, and one of a single value.
TEST_F(StagesTest, DepthMapsOfAnotherShapeAreRefused) {
  Extract();
  for (int i = 0; i < 2; ++i) AddDepth(i);
  WriteNpy(depth_ + "/" + Name(2) + ".npy", 12, 16, std::vector<float>(16 * 12, 2));
  WriteNpy(depth_ + "/" + Name(3) + ".npy", 1, 1, {2});
  TestMonitor monitor;
  Depth(monitor);
  EXPECT_THAT(monitor.warnings(), ElementsAre(HasSubstr("it is transposed; it has no depth"),
                                              HasSubstr("a map of 1 x 1 values has no gradient"),
                                              "no depth for 2 photos"));
  EXPECT_EQ(database_.ReadNumDepthSamples().size(), 2u);
}

// Rows that other programs wrote or deleted: no camera, and one of an unknown model without a size.
TEST_F(StagesTest, AnImageWithoutAUsableCameraHasNoDepth) {
  Extract();
  for (int i = 0; i < 4; ++i) AddDepth(i);
  RunSql(database_.path(), "UPDATE images SET camera_id = 70 + image_id WHERE image_id < 3");
  RunSql(database_.path(), "INSERT INTO cameras VALUES (72, 99, 0, 0, zeroblob(8), 0)");
  TestMonitor monitor;
  Depth(monitor);
  EXPECT_THAT(monitor.warnings(),
              AllOf(Contains("photo0.png: the database has no usable camera 71; it has no depth"),
                    Contains("photo1.png: the database has no usable camera 72; it has no depth")));
  EXPECT_EQ(database_.ReadNumDepthSamples().size(), 2u);
}

TEST_F(StagesTest, ChangedDepthAndChangedDepthOptionsAreNoticed) {
  Extract();
  for (int i = 0; i < 4; ++i) AddDepth(i);
  Depth();
  DepthOptions options;
  options.kind = DepthKind::kInverse;
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { Depth(NullMonitor(), options); }),
              HasSubstr("depth.kind: is \"inverse\""));
  AddDepth(1, 7);
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { Depth(); }), HasSubstr(Name(1)));
}

TEST_F(StagesTest, DepthStaysWhereItsMapIsGone) {
  Extract();
  for (int i = 0; i < 4; ++i) AddDepth(i);
  Depth();
  fs::remove(depth_ + "/" + Name(1) + ".npy");
  TestMonitor monitor;
  EXPECT_EQ(Depth(monitor).status, StageStatus::kOk);
  EXPECT_EQ(monitor.num_done(), 0);
  EXPECT_EQ(database_.ReadNumDepthSamples().size(), 4u);
}

TEST_F(StagesTest, NoDepthSourceIsFine) {
  Extract();
  const StageReport report = SampleImageDepth(database_, images_, {}, {}, {.num_threads = 2});
  EXPECT_EQ(report.status, StageStatus::kSkipped);
  EXPECT_FALSE(database_.ReadStage("depth"));
}

TEST_F(StagesTest, AllPairsAreMatchedAsByTheMatcher) {
  Extract();
  EXPECT_EQ(Match().status, StageStatus::kOk);
  EXPECT_EQ(database_.ReadNumMatches().size(), 6u);
  const Descriptors first = *database_.ReadDescriptors(1), second = *database_.ReadDescriptors(2);
  const Polarities of_first = database_.ReadPolarities(1, first),
                   of_second = database_.ReadPolarities(2, second);
  EXPECT_EQ(std::ssize(of_first), first.rows());
  const FeatureMatches matches = MatchDescriptors({first, of_first}, {second, of_second}, {});
  EXPECT_GT(matches.size(), 20u);
  EXPECT_EQ(*database_.ReadMatches(ImagePairToPairId(1, 2)), matches);
  // Changed polarities are changed features, and they decide what matches.
  Polarities inverted = of_first;
  for (uint8_t& polarity : inverted) polarity = 1 - polarity;
  database_.WriteDescriptors(1, first, inverted);
  EXPECT_THROW(Match(), ConfigError);
  database_.ClearStage("matching");
  Match();
  EXPECT_EQ(*database_.ReadMatches(ImagePairToPairId(1, 2)),
            MatchDescriptors({first, inverted}, {second, of_second}, {}));
  EXPECT_NE(*database_.ReadMatches(ImagePairToPairId(1, 2)), matches);
}

TEST_F(StagesTest, OnlyListedPairsAreMatched) {
  Extract();
  std::ofstream(folder_ / "pairs.txt") << "# pairs\n"
                                       << Name(0) << " " << Name(3) << "\n\n"
                                       << Name(2) << "\t" << Name(1) << "\n"
                                       << Name(3) << " " << Name(0) << "\n"
                                       << Name(1) << " " << Name(1) << "\n"
                                       << Name(1) << " unknown.png\n";
  TestMonitor monitor;
  const auto pairs = ReadPairList(folder_ / "pairs.txt", database_.ReadImages(), monitor);
  EXPECT_THAT(pairs, ElementsAre(ImagePairToPairId(1, 4), ImagePairToPairId(2, 3)));
  EXPECT_THAT(monitor.warnings(),
              ElementsAre(HasSubstr("pairs.txt:6: "), HasSubstr("no image 'unknown.png'")));
  Match(pairs);
  EXPECT_EQ(database_.ReadNumMatches().size(), 2u);
  Match();  // The others join.
  EXPECT_EQ(database_.ReadNumMatches().size(), 6u);
}

TEST_F(StagesTest, PairListsWithBlanksInNamesAndBrokenLines) {
  const std::vector<Image> images = {{1, "a b.png", 1}, {2, "c d.png", 1}};
  std::ofstream(folder_ / "pairs.txt") << "a b.png c d.png\r\n";
  EXPECT_THAT(ReadPairList(folder_ / "pairs.txt", images), ElementsAre(ImagePairToPairId(1, 2)));
  std::ofstream(folder_ / "pairs.txt") << "\nlonely.png\n";
  EXPECT_THAT(ThrownMessage<IoError>([&] { ReadPairList(folder_ / "pairs.txt", images); }),
              HasSubstr("pairs.txt:2: 'lonely.png' is not two image names"));
  EXPECT_THROW(ReadPairList(folder_ / "no.txt", images), IoError);
  std::ofstream(folder_ / "pairs.txt") << "\xEF\xBB\xBF"
                                          "a b.png c d.png\n";
  EXPECT_THAT(ReadPairList(folder_ / "pairs.txt", images), ElementsAre(ImagePairToPairId(1, 2)));
  for (const char* text : {"", "# nothing\n", "c.png a.png\n", "a b.png a b.png\n"}) {
    std::ofstream(folder_ / "pairs.txt") << text;
    EXPECT_THAT(ThrownMessage<IoError>([&] { ReadPairList(folder_ / "pairs.txt", images); }),
                HasSubstr("pairs.txt: names no pair of photographs of the database"))
        << text;
  }
}

TEST_F(StagesTest, PairsChosenByAnotherProgramAreNotCompleted) {
  Extract();
  database_.WriteMatches(ImagePairToPairId(1, 2), {{0, 0}});
  database_.WriteMatches(ImagePairToPairId(2, 3), {{1, 1}});
  Match();
  // 1, 2, 3 were matched elsewhere, so only pairs with the new image 4 are added.
  std::vector<image_pair_t> pairs;
  for (const auto& [pair, num] : database_.ReadNumMatches()) pairs.push_back(pair);
  EXPECT_THAT(pairs,
              ElementsAre(ImagePairToPairId(1, 2), ImagePairToPairId(1, 4), ImagePairToPairId(2, 3),
                          ImagePairToPairId(2, 4), ImagePairToPairId(3, 4)));
  EXPECT_EQ(*database_.ReadMatches(ImagePairToPairId(1, 2)), (FeatureMatches{{0, 0}}));
  Match();  // Nor the next time.
  EXPECT_EQ(database_.ReadNumMatches().size(), 5u);
  Match({ImagePairToPairId(1, 3)});  // Unless named.
  EXPECT_EQ(database_.ReadNumMatches().size(), 6u);
}

TEST_F(StagesTest, DamagedRowsAreNamedAndTheRestGoesOn) {
  Extract();
  for (int i = 0; i < 4; ++i) AddDepth(i);
  RunSql(database_.path(), "UPDATE keypoints SET rows = 1 WHERE image_id = 2");
  RunSql(database_.path(), "UPDATE descriptors SET rows = 1 WHERE image_id = 2");
  TestMonitor monitor;
  EXPECT_EQ(Depth(monitor).status, StageStatus::kWarning);
  EXPECT_EQ(
      MatchImagePairs(database_, {AllPairs(database_)}, {}, {.num_threads = 2, .monitor = monitor})
          .status,
      StageStatus::kWarning);
  EXPECT_THAT(monitor.warnings(), ElementsAre(AllOf(HasSubstr("keypoints of image 2: 1 x 6 values"),
                                                    HasSubstr("; photo1.png has no depth")),
                                              AllOf(HasSubstr("descriptors of image 2: 1 x 128"),
                                                    HasSubstr("; photo1.png is not matched")),
                                              HasSubstr("1 photograph is not matched; for")));
  EXPECT_EQ(database_.ReadNumDepthSamples().size(), 3u);
  EXPECT_EQ(database_.ReadNumMatches().size(), 3u);
}

TEST_F(StagesTest, ChangedFeaturesAreNoticedByMatching) {
  Extract();
  Match();
  database_.WriteDescriptors(2, Descriptors::Constant(5, 128, 1));
  EXPECT_THAT(ThrownMessage<ConfigError>([&] { Match(); }),
              HasSubstr("the features of " + Name(1)));
  EXPECT_NO_THROW(Match({ImagePairToPairId(3, 4)}));  // Of other images.
}

}  // namespace
}  // namespace cairn
