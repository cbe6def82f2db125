#include <gtest/gtest.h>

#include "cairn/database/database.h"
#include "cairn/synthetic/scene.h"

namespace cairn {
namespace {

SyntheticScene MakeSmallScene() {
  SceneOptions options;
  options.num_images = 6;
  options.num_distractor_images = 1;
  options.num_points = 500;
  options.outlier_ratio = 0.2;
  options.num_clutter_keypoints = 100;
  options.num_chance_matches = 30;
  return MakeScene(options, 1);
}

TEST(SceneDatabase, HoldsWhatTheSceneHas) {
  const SyntheticScene scene = MakeSmallScene();
  Database database(":memory:");
  WriteScene(scene, SceneContent::kTwoViewGeometries, database);
  EXPECT_EQ(database.ReadCameras().size(), 2u);
  ASSERT_EQ(database.ReadImages().size(), 7u);
  for (const Image& image : scene.images) {
    const auto keypoints = database.ReadKeypoints(image.image_id);
    ASSERT_TRUE(keypoints.has_value());
    EXPECT_EQ(*keypoints, scene.keypoints.at(image.image_id));
    const auto depth = database.ReadDepthSamples(image.image_id);
    ASSERT_TRUE(depth.has_value());
    ASSERT_EQ(depth->size(), keypoints->size());
    EXPECT_EQ((*depth)[3].depth, scene.depth_samples.at(image.image_id)[3].depth);
    const auto descriptors = database.ReadDescriptors(image.image_id);
    ASSERT_TRUE(descriptors.has_value());
    EXPECT_EQ(*descriptors, MakeDescriptors(scene, image.image_id));
  }
  EXPECT_EQ(database.ReadMatchedPairIds().size(), 21u);  // every pair, by chance at least
  const SyntheticMatches matches = MakeMatches(scene, 1, 2);
  EXPECT_EQ(database.ReadMatches(ImagePairToPairId(1, 2)), matches.matches);
  const auto geometry = database.ReadTwoViewGeometry(ImagePairToPairId(1, 2));
  ASSERT_TRUE(geometry.has_value());
  const TwoViewGeometry truth = TrueTwoViewGeometry(scene, 1, 2, matches);
  EXPECT_EQ(geometry->config, TwoViewConfig::kCalibrated);
  EXPECT_EQ(geometry->inlier_matches, truth.inlier_matches);
  EXPECT_LT(AngleBetween(geometry->cam2_from_cam1->rotation, truth.cam2_from_cam1->rotation),
            1e-12);
  // The distractor is verified with nobody.
  for (const image_pair_t pair_id : database.ReadTwoViewGeometryPairIds()) {
    EXPECT_NE(PairIdToImagePair(pair_id).second, 7u);
  }
}

TEST(SceneDatabase, ContentEndsWhereAskedFor) {
  const SyntheticScene scene = MakeSmallScene();
  for (const SceneContent content :
       {SceneContent::kFeatures, SceneContent::kDepth, SceneContent::kMatches}) {
    Database database(":memory:");
    WriteScene(scene, content, database);
    EXPECT_TRUE(database.ReadKeypoints(1).has_value());
    EXPECT_EQ(database.ReadDepthSamples(1).has_value(), content >= SceneContent::kDepth);
    EXPECT_EQ(database.ReadMatchedPairIds().empty(), content < SceneContent::kMatches);
    EXPECT_TRUE(database.ReadTwoViewGeometryPairIds().empty());
  }
}

}  // namespace
}  // namespace cairn
