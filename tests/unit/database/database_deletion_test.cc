// What goes with what is deleted, or changed.
#include "unit/database/database_fixture.h"

namespace cairn {
namespace {

TEST_F(DatabaseTest, DeleteImageTakesItsFeaturesAndItsUnusedCamera) {
  Database database(":memory:");
  WriteImages(database, 2);
  database.WriteCamera(TestCamera(2));
  database.WriteImage({3, "c.jpg", 2});
  database.WriteKeypoints(3, RandomKeypoints(1, 1));
  database.DeleteImage(3);
  database.DeleteImage(1);
  EXPECT_EQ(database.ReadImages().size(), 1u);
  EXPECT_FALSE(database.ReadKeypoints(3));
  ASSERT_EQ(database.ReadCameras().size(), 1u);
  EXPECT_EQ(database.ReadCameras()[0].camera_id, 1u);
  database.WriteCamera(TestCamera(9));
  database.DeleteUnusedCameras();
  ASSERT_EQ(database.ReadCameras().size(), 1u);
}

TEST_F(DatabaseTest, IdsOfDeletedImagesAreTaken) {
  Database database(":memory:");
  EXPECT_EQ(database.ReadLargestTakenImageId(), 0u);
  WriteImages(database, 3);
  database.DeleteImage(3);
  EXPECT_EQ(database.ReadLargestTakenImageId(), 3u);  // models may still have it
  database.DeleteImage(2);
  database.DeleteImage(1);
  EXPECT_EQ(database.ReadLargestTakenImageId(), 0u);  // all begins anew
}

TEST_F(DatabaseTest, DeletedFeaturesTakeTheirPairsAndLeaveImagesAndCameras) {
  Database database(":memory:");
  WriteImages(database, 4);
  for (const image_t id : {1u, 2u, 3u, 4u}) {
    database.WriteKeypoints(id, RandomKeypoints(1, 1));
    database.WriteDescriptors(id, Descriptors::Random(1, 128));
    database.WriteDepthSamples(id, std::vector<DepthSample>(1));
    database.WriteJob("cameras", {id, 1, ""});
    database.WriteJob("features", {id, 1, ""});
    database.WritePhoto({"image" + std::to_string(id) + ".jpg", 1, ""});
  }
  const image_pair_t left = ImagePairToPairId(3, 4);
  for (const auto pair : {ImagePairToPairId(1, 2), ImagePairToPairId(1, 3), left}) {
    database.WriteMatches(pair, {{0, 0}});
    database.WriteTwoViewGeometry(pair, TestGeometry());
    database.WriteJob("verification", {pair, 1, ""});
    database.WriteTiming("verification", pair, "fast", 1.0);
    database.WritePairChoice({pair, 0, "exhaustive"});
    PairMetrics metrics;
    metrics.pair_id = pair;
    metrics.verifier = "fast";
    database.WritePairMetrics(metrics);
    database.WriteFocalEvidence({.pair_id = pair});
  }
  database.AddStageTime("verification", 1.0);
  database.WriteCameraLens(1, {.focal_px = 500, .focal_sigma = 0.1});
  database.DeleteFeaturesAndPairs({1, 2});
  EXPECT_EQ(database.ReadImages().size(), 4u);
  EXPECT_EQ(database.ReadCameraLenses().size(), 1u);
  EXPECT_EQ(database.ReadJobs("cameras").size(), 4u);
  EXPECT_EQ(database.ReadJobs("features").size(), 2u);
  EXPECT_EQ(database.ReadNumKeypoints(), (std::map<image_t, int>{{3, 1}, {4, 1}}));
  EXPECT_EQ(database.ReadNumDescriptors().size(), 2u);
  EXPECT_EQ(database.ReadNumDepthSamples().size(), 2u);
  const auto expected = std::vector<std::pair<image_pair_t, int>>{{left, 1}};
  EXPECT_EQ(database.ReadNumMatches(), expected);
  EXPECT_EQ(database.ReadNumInliers().size(), 1u);
  EXPECT_EQ(database.ReadJobs("verification").size(), 1u);
  EXPECT_TRUE(database.ReadTiming("verification", left, "fast"));
  EXPECT_TRUE(database.ReadTiming("verification", 0, ""));
  EXPECT_FALSE(database.ReadTiming("verification", ImagePairToPairId(1, 3), "fast"));
  EXPECT_EQ(database.ReadPairChoices().size(), 1u);
  EXPECT_EQ(database.ReadPairMetrics().size(), 1u);
  EXPECT_EQ(database.ReadFocalEvidence().size(), 1u);
  // An id that COLMAP's schema allows.
  database.WriteImage({0, "zero.jpg", 1});
  database.WriteMatches(ImagePairToPairId(0, 4), {{0, 0}});
  database.DeleteFeaturesAndPairs({0});
  EXPECT_EQ(database.ReadNumMatches(), expected);
  database.DeleteImage(0);
  database.DeleteImagesAndPairs({1, 2, 3});
  EXPECT_EQ(database.ReadImages().size(), 1u);
  EXPECT_EQ(database.ReadJobs("cameras").size(), 1u);
  EXPECT_EQ(database.ReadPhotos().size(), 1u);
  EXPECT_TRUE(database.ReadNumMatches().empty());
}

TEST_F(DatabaseTest, WhatWasLearnedOfACameraGoesWhereItsRowChanges) {
  Database database(":memory:");
  WriteImages(database, 1);
  Camera camera = database.ReadCameras()[0];
  database.WriteCameraFocals({{camera.camera_id, {true, 5, 4}}});
  database.WriteCameraLens(camera.camera_id, {.focal_px = 500, .focal_sigma = 0.1});
  database.WriteCamera(camera);
  EXPECT_EQ(database.ReadCameraLenses().size(), 1u);
  EXPECT_EQ(database.ReadCameraFocals().size(), 1u);
  camera.params[0] += 1;
  database.WriteCamera(camera);
  EXPECT_TRUE(database.ReadCameraLenses().empty());
  EXPECT_TRUE(database.ReadCameraFocals().empty());
}

}  // namespace
}  // namespace cairn
