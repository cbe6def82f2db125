#include "cairn/synthetic/scene.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <set>

#include "cairn/base/error.h"
#include "cairn/geometry/epipolar.h"
#include "support/check_consistency.h"
#include "support/scene_view_graph.h"
#include "support/test.h"

namespace cairn {
namespace {

SceneOptions SmallSceneOptions() {
  SceneOptions options;
  options.num_images = 8;
  options.num_points = 600;
  return options;
}

TEST(Scene, ExactReconstructionIsConsistent) {
  for (const auto& [layout, name] : kCameraLayouts) {
    for (const CameraModel model :
         {CameraModel::kSimplePinhole, CameraModel::kSimpleRadial, CameraModel::kOpenCV}) {
      SceneOptions options = SmallSceneOptions();
      options.layout = layout;
      options.camera_model = model;
      options.radial_distortion = -0.05;
      const Reconstruction truth = MakeScene(options, 1).truth;
      EXPECT_NO_THROW(CheckConsistency(truth));
      EXPECT_EQ(truth.images.size(), 8u);
      EXPECT_GT(truth.points3D.size(), 100u) << name;
      EXPECT_LT(truth.MeanReprojectionErrorPx(), 1e-4) << "float keypoints";
      EXPECT_GT(truth.MeanTrackLength(), 2.0);
    }
  }
}

TEST(Scene, KeypointNoiseIsTheReprojectionError) {
  SceneOptions options = SmallSceneOptions();
  options.image_noise_px = 2.0;
  const Reconstruction truth = MakeScene(options, 1).truth;
  // Mean of a Rayleigh distribution.
  EXPECT_NEAR(truth.MeanReprojectionErrorPx(), 2.0 * std::sqrt(std::numbers::pi / 2), 0.1);
}

TEST(Scene, CamerasDiffer) {
  SceneOptions options = SmallSceneOptions();
  options.num_cameras = 3;
  const SyntheticScene scene = MakeScene(options, 1);
  ASSERT_EQ(scene.cameras.size(), 3u);
  std::set<double> focals;
  for (const auto& [id, camera] : scene.cameras) {
    EXPECT_EQ(camera.Validate(), "");
    EXPECT_TRUE(camera.has_prior_focal_length);
    focals.insert(camera.MeanFocal());
  }
  EXPECT_EQ(focals.size(), 3u);
  EXPECT_NE(scene.cameras.at(1).width, scene.cameras.at(2).width);
}

TEST(Scene, DepthSamplesLieOnTheSurfaceInTheImagesOwnUnit) {
  SceneOptions options = SmallSceneOptions();
  options.missing_depth_ratio = 0.3;
  const SyntheticScene scene = MakeScene(options, 2);
  int num_missing = 0, num_all = 0;
  for (const auto& [id, image] : scene.truth.images) {
    double unit = 0;
    for (size_t k = 0; k < image.point3D_ids.size(); ++k) {
      if (image.point3D_ids[k] == kInvalidPoint3DId) continue;
      const DepthSample& sample = scene.depth_samples.at(id)[k];
      ++num_all;
      num_missing += !sample.is_valid;
      if (!sample.is_valid) continue;
      const Eigen::Vector3d x =
          image.cam_from_world * scene.truth.points3D.at(image.point3D_ids[k]).xyz;
      if (unit == 0) unit = sample.depth / x.z();
      EXPECT_NEAR(sample.depth, x.z() * unit, 1e-5 * sample.depth);
    }
  }
  EXPECT_NEAR(num_missing, 0.3 * num_all, 0.05 * num_all);
}

TEST(Scene, MatchesHaveTheChosenShareOfWrongOnes) {
  SceneOptions options = SmallSceneOptions();
  options.num_clutter_keypoints = 300;
  for (const double ratio : {0.0, 0.3, 0.8}) {
    options.outlier_ratio = ratio;
    const SyntheticScene scene = MakeScene(options, 3);
    const SyntheticMatches matches = MakeMatches(scene, 1, 2);
    ASSERT_GT(matches.matches.size(), 50u);
    const auto num_inliers = std::count(matches.is_inlier.begin(), matches.is_inlier.end(), true);
    EXPECT_NEAR(1.0 - double(num_inliers) / matches.matches.size(), ratio, 0.02);
    std::set<point2D_t> used1, used2;
    for (size_t i = 0; i < matches.matches.size(); ++i) {
      const auto [k1, k2] = matches.matches[i];
      EXPECT_TRUE(used1.insert(k1).second);
      EXPECT_TRUE(used2.insert(k2).second);
      const point3D_t p1 = scene.truth.images.at(1).point3D_ids.at(k1);
      const point3D_t p2 = scene.truth.images.at(2).point3D_ids.at(k2);
      EXPECT_EQ(p1 == p2 && p1 != kInvalidPoint3DId, matches.is_inlier[i]);
    }
  }
}

TEST(Scene, ChanceMatchesOnlyWhereNothingIsShared) {
  SceneOptions options = SmallSceneOptions();
  options.num_chance_matches = 25;
  options.num_distractor_images = 2;
  const SyntheticScene scene = MakeScene(options, 4);
  ASSERT_EQ(scene.images.size(), 10u);
  EXPECT_EQ(scene.truth.images.size(), 8u);
  const SyntheticMatches chance = MakeMatches(scene, 1, 9);
  EXPECT_EQ(chance.matches.size(), 25u);
  EXPECT_EQ(std::count(chance.is_inlier.begin(), chance.is_inlier.end(), true), 0);
  EXPECT_EQ(MakeMatches(scene, 9, 10).matches.size(), 25u);
  options.num_chance_matches = 0;
  EXPECT_TRUE(MakeMatches(MakeScene(options, 4), 1, 9).matches.empty());
}

TEST(Scene, TrueGeometryFitsItsInliers) {
  SceneOptions options = SmallSceneOptions();
  options.outlier_ratio = 0.3;
  options.num_clutter_keypoints = 200;
  const SyntheticScene scene = MakeScene(options, 5);
  const SyntheticMatches matches = MakeMatches(scene, 1, 2);
  const TwoViewGeometry geometry = TrueTwoViewGeometry(scene, 1, 2, matches);
  EXPECT_EQ(geometry.config, TwoViewConfig::kCalibrated);
  ASSERT_GT(geometry.inlier_matches.size(), 50u);
  for (const FeatureMatch& match : geometry.inlier_matches) {
    const Eigen::Vector2d x1 = scene.truth.images.at(1).points2D[match.point1];
    const Eigen::Vector2d x2 = scene.truth.images.at(2).points2D[match.point2];
    EXPECT_LT(SquaredSampsonError(*geometry.F, x1, x2), 1e-6);  // pixels, float keypoints
  }
}

TEST(Scene, ViewGraphJoinsImagesWithCommonPoints) {
  const SyntheticScene scene = MakeScene(SmallSceneOptions(), 6);
  const ViewGraph graph = MakeViewGraph(scene, 30);
  EXPECT_EQ(graph.image_ids.size(), 8u);
  ASSERT_GE(graph.edges.size(), 8u);   // a ring
  EXPECT_LT(graph.edges.size(), 28u);  // opposite sides see nothing in common
  for (const ViewEdge& edge : graph.edges) {
    EXPECT_GE(edge.num_inliers, 30);
    EXPECT_GT(edge.triangulation_angle_deg, 5);
    const SyntheticMatches matches = MakeMatches(scene, edge.image_id1, edge.image_id2);
    EXPECT_EQ(static_cast<int>(matches.matches.size()), edge.num_inliers);
  }
}

TEST(Scene, DescriptorsOfTheSamePointAreNearest) {
  SceneOptions options = SmallSceneOptions();
  options.num_clutter_keypoints = 100;
  const SyntheticScene scene = MakeScene(options, 7);
  const Descriptors d1 = MakeDescriptors(scene, 1), d2 = MakeDescriptors(scene, 2);
  ASSERT_EQ(d1.cols(), 128);
  ASSERT_EQ(d1.rows(), static_cast<int>(scene.keypoints.at(1).size()));
  const auto distance = [&](int a, int b) {
    return (d1.row(a).cast<int>() - d2.row(b).cast<int>()).squaredNorm();
  };
  for (const FeatureMatch& match : MakeMatches(scene, 1, 2).matches) {
    int nearest = 0;
    for (int k = 1; k < d2.rows(); ++k) {
      if (distance(match.point1, k) < distance(match.point1, nearest)) nearest = k;
    }
    EXPECT_EQ(nearest, static_cast<int>(match.point2));
  }
}

TEST(Scene, SameSeedSameScene) {
  SceneOptions options = SmallSceneOptions();
  options.image_noise_px = 0.5;
  const SyntheticScene a = MakeScene(options, 8), b = MakeScene(options, 8),
                       c = MakeScene(options, 9);
  EXPECT_EQ(a.keypoints, b.keypoints);
  EXPECT_EQ(MakeMatches(a, 1, 2).matches, MakeMatches(b, 1, 2).matches);
  EXPECT_NE(a.keypoints, c.keypoints);
}

// Every option changes the scene (layout, camera_model and the rest).
TEST(Scene, EveryOptionHasAnEffect) {
  using Change = std::function<void(SceneOptions&)>;
  const std::vector<Change> changes = {
      [](SceneOptions& o) { o.layout = CameraLayout::kArc; },
      [](SceneOptions& o) { o.num_images = 9; },
      [](SceneOptions& o) { o.num_points = 601; },
      [](SceneOptions& o) { o.max_keypoints = 50; },
      [](SceneOptions& o) { o.num_cameras = 3; },
      [](SceneOptions& o) { o.own_camera_share = 0.5; },
      [](SceneOptions& o) { o.radial_distortion = 0.1; },
      [](SceneOptions& o) { o.image_width = 900; },
      [](SceneOptions& o) { o.image_height = 900; },
      [](SceneOptions& o) { o.distance = 4; },
      [](SceneOptions& o) { o.image_noise_px = 1; },
      [](SceneOptions& o) { o.affine_noise = 0.1; },
      [](SceneOptions& o) { o.depth_noise = 0.1; },
      [](SceneOptions& o) { o.depth_gradient_noise = 0.1; },
      [](SceneOptions& o) { o.missing_depth_ratio = 0.5; },
      [](SceneOptions& o) { o.num_clutter_keypoints = 10; },
      [](SceneOptions& o) { o.num_distractor_images = 1; },
      [](SceneOptions& o) { o.outlier_ratio = 0.5; },
      [](SceneOptions& o) { o.num_chance_matches = 10; },
  };
  SceneOptions base = SmallSceneOptions();
  base.camera_model = CameraModel::kSimpleRadial;
  const auto fingerprint = [](const SceneOptions& options) {
    const SyntheticScene scene = MakeScene(options, 10);
    std::vector<float> values;
    for (const auto& [id, keypoints] : scene.keypoints) {
      for (const Keypoint& k : keypoints) values.insert(values.end(), {k.x, k.y, k.a11, k.a12});
      for (const DepthSample& d : scene.depth_samples.at(id)) {
        values.insert(values.end(), {d.depth, d.ddepth_dx, static_cast<float>(d.is_valid)});
      }
    }
    for (const image_t id2 : {2, 5}) {
      for (const FeatureMatch& m : MakeMatches(scene, 1, id2).matches) {
        values.insert(values.end(), {float(m.point1), float(m.point2)});
      }
    }
    return values;
  };
  const std::vector<float> reference = fingerprint(base);
  for (size_t i = 0; i < changes.size(); ++i) {
    SceneOptions options = base;
    changes[i](options);
    EXPECT_NE(fingerprint(options), reference) << "change " << i;
  }
  base.layout = static_cast<CameraLayout>(99);
  EXPECT_THROW(MakeScene(base, 1), ConfigError);
}

}  // namespace
}  // namespace cairn
