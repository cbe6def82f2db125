#include <algorithm>
#include <set>

#include "cairn/base/error.h"
#include "cairn/database/database.h"
#include "cairn/math/angles.h"
#include "cairn/synthetic/scene.h"
#include "support/test.h"

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

TEST(SceneDatabase, WrongPairsOfACityAreOfPlacesThatLookAlike) {
  SceneOptions options;
  options.layout = CameraLayout::kCity;
  options.num_images = 600;
  options.num_distractor_images = 2;
  options.num_points = 3000;
  options.max_keypoints = 400;
  options.descriptors = false;
  options.num_pairs = 1500;
  options.pair_outlier_ratio = 0.2;
  const SyntheticScene scene = MakeScene(options, 1);
  Database database(":memory:");
  WriteScene(scene, SceneContent::kTwoViewGeometries, database);
  int num_wrong = 0;
  for (const image_pair_t pair_id : database.ReadTwoViewGeometryPairIds()) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    const Rigid3d truth = scene.truth.images.at(id2).cam_from_world *
                          Inverse(scene.truth.images.at(id1).cam_from_world);
    const TwoViewGeometry geometry = *database.ReadTwoViewGeometry(pair_id);
    num_wrong += AngleBetween(geometry.cam2_from_cam1->rotation, truth.rotation) > 0.01;
  }
  EXPECT_EQ(num_wrong, 300);
}

// Right ones would be taken for wrong, or be missing.
TEST(SceneDatabase, ACityWithoutPlacesThatLookAlikeHasNoWrongPairs) {
  SceneOptions options;
  options.layout = CameraLayout::kCity;
  options.num_points = 300;
  options.num_images = 600;
  options.pair_outlier_ratio = 0.2;
  EXPECT_THROW(MakeScene(options, 1), ConfigError);
  options.num_pairs = 100;
  for (const int num_images : {8, 300, 500}) {
    options.num_images = num_images;
    EXPECT_THROW(MakeScene(options, 1), ConfigError) << num_images;
  }
  options.pair_outlier_ratio = 0;
  EXPECT_EQ(MakeScene(options, 1).images.size(), 500u);
}

SceneOptions CrowdOptions() {
  SceneOptions options;
  options.layout = CameraLayout::kLandmark;
  options.num_images = 30;
  options.num_points = 3000;
  options.max_keypoints = 300;
  options.num_pairs = 100;
  options.descriptors = false;
  return options;
}

std::map<image_pair_t, TwoViewGeometry> Geometries(const SceneOptions& options) {
  Database database(":memory:");
  WriteScene(MakeScene(options, 1), SceneContent::kTwoViewGeometries, database);
  std::map<image_pair_t, TwoViewGeometry> geometries;
  for (const image_pair_t pair_id : database.ReadTwoViewGeometryPairIds()) {
    geometries[pair_id] = *database.ReadTwoViewGeometry(pair_id);
  }
  return geometries;
}

double TotalMatches(const std::map<image_pair_t, TwoViewGeometry>& geometries) {
  double sum = 0;
  for (const auto& [id, geometry] : geometries) {
    sum += static_cast<double>(geometry.inlier_matches.size());
  }
  return sum;
}

TEST(SceneDatabase, KeepsThePairsWithTheMostPointsInCommonAndOneComponent) {
  SceneOptions options = CrowdOptions();
  const auto some = Geometries(options);
  EXPECT_EQ(some.size(), 100u);
  std::set<image_t> images;
  for (const auto& [id, geometry] : some) {
    images.insert(PairIdToImagePair(id).first);
    images.insert(PairIdToImagePair(id).second);
  }
  EXPECT_EQ(images.size(), 30u);
  options.num_pairs = 0;
  const auto all = Geometries(options);
  EXPECT_GT(all.size(), 200u);
  EXPECT_GT(TotalMatches(some) / 100, 1.3 * TotalMatches(all) / static_cast<double>(all.size()));
}

TEST(SceneDatabase, SalientPointsAreInMoreImages) {
  SceneOptions options = CrowdOptions();
  options.max_keypoints = 100;
  const double even = TotalMatches(Geometries(options));
  options.salience = 1.0;
  EXPECT_GT(TotalMatches(Geometries(options)), 1.5 * even);
}

TEST(SceneDatabase, PairsAreAsWrongAsAskedFor) {
  const SceneOptions exact_options = CrowdOptions();
  const SyntheticScene scene = MakeScene(exact_options, 1);
  const auto errors_deg = [&](const SceneOptions& options) {
    std::vector<double> errors;
    for (const auto& [id, geometry] : Geometries(options)) {
      const auto [id1, id2] = PairIdToImagePair(id);
      const Rigid3d truth = scene.truth.images.at(id2).cam_from_world *
                            Inverse(scene.truth.images.at(id1).cam_from_world);
      errors.push_back(RadToDeg(AngleBetween(geometry.cam2_from_cam1->rotation, truth.rotation)));
    }
    std::sort(errors.begin(), errors.end());
    return errors;
  };
  EXPECT_LT(errors_deg(exact_options).back(), 1e-6);
  SceneOptions options = exact_options;
  options.rotation_noise_deg = 2;
  options.direction_noise_deg = 2;
  std::vector<double> errors = errors_deg(options);
  EXPECT_NEAR(errors[50], 2.0, 0.7);
  EXPECT_LT(errors.back(), 20);
  options.heavy_tail = 1;
  EXPECT_GT(errors_deg(options).back(), 20);
  options = exact_options;
  options.pair_outlier_ratio = 0.2;
  errors = errors_deg(options);
  EXPECT_LT(errors[75], 1e-6);
  EXPECT_GT(errors[82], 1.0);
}

TEST(SceneDatabase, WritesTheVerifiersRecordsAndDescriptorsIfAskedTo) {
  SceneOptions options = CrowdOptions();
  options.pair_metrics = true;
  options.pair_outlier_ratio = 0.1;
  Database database(":memory:");
  WriteScene(MakeScene(options, 1), SceneContent::kTwoViewGeometries, database);
  EXPECT_TRUE(database.ReadNumDescriptors().empty());
  const std::vector<PairMetrics> metrics = database.ReadPairMetrics();
  ASSERT_EQ(metrics.size(), 100u);
  for (const PairMetrics& m : metrics) {
    const TwoViewGeometry geometry = *database.ReadTwoViewGeometry(m.pair_id);
    EXPECT_TRUE(m.is_winner);
    EXPECT_EQ(m.num_inliers, static_cast<int>(geometry.inlier_matches.size()));
    EXPECT_EQ(m.cam2_from_cam1->translation, geometry.cam2_from_cam1->translation);
  }
}

}  // namespace
}  // namespace cairn
