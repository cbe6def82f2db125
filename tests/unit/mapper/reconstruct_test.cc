#include "cairn/mapper/reconstruct.h"

#include <algorithm>
#include <set>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "cairn/synthetic/scene.h"
#include "database/stage_names.h"
#include "mapper/stages.h"
#include "support/check_consistency.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "support/thrown_message.h"
#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {
namespace {

TEST(Reconstruct, RecoversAScene) {
  const SyntheticScene scene = MakeScene(SmallScene(), 1);
  const ReconstructResult result = Reconstruct(MakeDatabase(scene));
  ASSERT_TRUE(result.report.Succeeded()) << result.report.failure;
  ASSERT_EQ(result.models.size(), 1u);
  const Reconstruction& model = result.models.front();
  CheckConsistency(model);
  EXPECT_EQ(model.images.size(), 10u);
  EXPECT_GT(model.points3D.size(), 300u);
  const auto difference = CompareAligned(model, scene.truth);
  EXPECT_LT(difference.center, 2e-3 * Extent(scene.truth));
  EXPECT_LT(difference.angle, 2e-3);
  EXPECT_LT(model.MeanReprojectionErrorPx(), 0.5);
}

TEST(Reconstruct, ReportsEveryStage) {
  const SyntheticScene scene = MakeScene(SmallScene(), 2);
  const ReconstructResult result =
      Reconstruct(MakeDatabase(scene), "", {}, {.seed = 11, .num_threads = 1});
  EXPECT_EQ(result.report.seed, 11u);
  EXPECT_EQ(result.report.num_threads, 1);
  for (const char* name :
       {"read", "view_graph", "rotation_averaging", "tracks", "translation_averaging",
        "triangulation", "bundle_adjustment", "filter", "checks"}) {
    const StageReport* stage = FindStage(result.report, name);
    ASSERT_NE(stage, nullptr) << name;
    EXPECT_GE(stage->seconds, 0) << name;
    EXPECT_FALSE(stage->values.empty()) << name;
  }
  EXPECT_THAT(ToJson(result.report), HasSubstr("\"succeeded\": true"));
  EXPECT_EQ(FindStage(result.report, "colors"), nullptr);  // no photographs are named
}

TEST(Reconstruct, PositionsComeOfSomeTracksOfEachImage) {
  const Database database = MakeDatabase(MakeScene(SmallScene(), 2));
  const auto num_tracks = [&](int per_image) {
    ReconstructSettings settings;
    settings.reconstruct.position_tracks_per_image = per_image;
    const RunReport report = Reconstruct(database, settings).report;
    return Value(*FindStage(report, "translation_averaging"), "tracks_in");
  };
  EXPECT_LE(num_tracks(1), 10);  // of ten images
  EXPECT_GT(num_tracks(20), 20);
}

TEST(Reconstruct, OptionsReachTheirStages) {
  const Database database = MakeDatabase(MakeScene(SmallScene(), 2));
  // Of the last stage with this name.
  const auto value = [&](const std::string& name, const std::string& key, const auto& change) {
    ReconstructSettings settings;
    change(settings);
    RunReport report = Reconstruct(database, settings).report;
    std::ranges::reverse(report.stages);
    return Value(*FindStage(report, name), key);
  };
  const auto with = [&](const std::string& name, const std::string& key, const auto& change) {
    return value(name, key, change) / value(name, key, [](ReconstructSettings&) {});
  };
  EXPECT_LT(with("tracks", "tracks_out", [](auto& s) { s.tracks.min_length = 4; }), 0.5);
  EXPECT_LT(with("triangulation", "observations_out",
                 [](auto& s) { s.triangulation.max_error_px = 0.3; }),
            0.9);
  EXPECT_EQ(value("bundle_adjustment", "iterations",
                  [](auto& s) { s.bundle_adjustment.max_iterations = 1; }),
            1);
  EXPECT_LT(with("translation_averaging", "iterations",
                 [](auto& s) { s.translation_averaging.max_iterations = 1; }),
            0.5);
  // Trees of pairs as they are, not averaged.
  EXPECT_GT(with("rotation_averaging", "median_residual_deg",
                 [](auto& s) {
                   RotationAveragingOptions& options = s.rotation_averaging;
                   options.max_l1_iterations = options.max_irls_iterations = 0;
                   options.max_consensus_rounds = options.max_region_rounds = 0;
                 }),
            1.3);
  EXPECT_GT(with("rotation_averaging", "edges_rejected",
                 [](auto& s) { s.rotation_averaging.max_error_deg = 1e-3; }),
            1);
  // By two powers of the numbers of inliers, or three, and two trees.
  const auto num_averaged = [&](double weight_power) {
    return value("rotation_averaging", "averaged",
                 [=](auto& s) { s.rotation_averaging.weight_power = weight_power; });
  };
  EXPECT_EQ(num_averaged(0), 4);
  EXPECT_EQ(num_averaged(0.5), 5);
}

TEST(Reconstruct, RefusesOptionsOfAnyStageBeforeAnyWork) {
  const Database database(":memory:");
  const auto expect = [&](const std::string& option, auto change) {
    ReconstructSettings settings;
    change(settings);
    TestMonitor monitor;
    EXPECT_THAT(ThrownMessage<ConfigError>(
                    [&] { Reconstruct(database, "", settings, {.monitor = monitor}); }),
                HasSubstr(option));
    EXPECT_TRUE(monitor.stages().empty());
  };
  expect("reconstruct.max_rounds", [](auto& s) { s.reconstruct.max_rounds = 0; });
  expect("focal_calibration.min_pairs", [](auto& s) { s.focal_calibration.min_pairs = -1; });
  expect("view_graph.min_num_inliers", [](auto& s) { s.view_graph.min_num_inliers = -1; });
  expect("rotation_averaging.max_error_deg",
         [](auto& s) { s.rotation_averaging.max_error_deg = -1; });
  expect("translation_averaging.huber_deg", [](auto& s) { s.translation_averaging.huber_deg = 0; });
  expect("tracks.min_length", [](auto& s) { s.tracks.min_length = 0; });
  expect("triangulation.min_views", [](auto& s) { s.triangulation.min_views = 1; });
  expect("bundle_adjustment.max_iterations",
         [](auto& s) { s.bundle_adjustment.max_iterations = -1; });
  expect("resection.min_num_inliers", [](auto& s) { s.resection.min_num_inliers = -1; });
}

// The first rounds allow larger errors.
TEST(Reconstruct, TakesThresholdsAsLargeAsOneLikes) {
  ReconstructSettings settings;
  settings.triangulation.max_error_px = settings.triangulation.max_error_sigmas = 1e6;
  EXPECT_EQ(Reconstruct(MakeDatabase(MakeScene(SmallScene(), 2)), settings).models.size(), 1u);
}

TEST(Reconstruct, GivesEqualBytesForAnyNumberOfThreads) {
  const Database database = MakeDatabase(MakeScene(SmallScene(), 4));
  const Reconstruction one = Reconstruct(database).models.at(0);
  for (const int num_threads : {2, 8}) {
    ExpectEqual(Reconstruct(database, "", {}, {.num_threads = num_threads}).models.at(0), one);
  }
}

// Two places whose facades are the same; images of one show none of what surrounds the other.
TEST(Reconstruct, SeparatesDuplicateStructure) {
  SceneOptions options;
  options.layout = CameraLayout::kArc;
  options.num_images = 12;
  options.num_points = 2000;
  options.image_noise_px = 0.3;
  options.outlier_ratio = 0.2;
  options.twin_places = true;
  const auto places = [](const Reconstruction& model) {
    std::set<int> found;
    for (const auto& [id, image] : model.images) found.insert(static_cast<int>(id % 2));
    return found.size();
  };
  for (const uint64_t seed : {1, 2, 3}) {
    const Database database = MakeDatabase(MakeScene(options, seed));
    ReconstructSettings settings;
    settings.reconstruct.separate_duplicates = false;
    const ReconstructResult folded = Reconstruct(database, settings);
    EXPECT_EQ(places(folded.models.at(0)), 2u);

    const ReconstructResult result = Reconstruct(database);
    ASSERT_EQ(result.models.size(), 2u);
    for (const Reconstruction& model : result.models) {
      EXPECT_EQ(places(model), 1u);
      EXPECT_EQ(model.images.size(), 6u);
    }
    int num_ambiguous = 0;
    for (const ViewEdge& edge : result.graph.edges) {
      const bool is_between = edge.image_id1 % 2 != edge.image_id2 % 2;
      num_ambiguous += edge.removal == EdgeRemoval::kAmbiguous;
      EXPECT_EQ(edge.IsActive(), !is_between);
    }
    EXPECT_GT(num_ambiguous, 20);
  }
  // One place is not torn apart, however many wrong matches there are.
  options.twin_places = false;
  options.outlier_ratio = 0.5;
  EXPECT_EQ(Reconstruct(MakeDatabase(MakeScene(options, 4))).models.size(), 1u);
}

// Where images share few of the many points that they could, misses are no sign of duplicate
// structure.
TEST(Reconstruct, OnePlaceWithFewRepeatedPointsIsKeptWhole) {
  SceneOptions options;
  options.layout = CameraLayout::kLandmark;
  options.num_images = 40;
  options.num_points = 8000;
  options.max_keypoints = 500;
  options.salience = 0.7;
  options.image_noise_px = 0.5;
  const ReconstructResult result = Reconstruct(MakeDatabase(MakeScene(options, 1)));
  const StageReport* duplicates = FindStage(result.report, "duplicate_structure");
  ASSERT_NE(duplicates, nullptr);
  EXPECT_EQ(Value(*duplicates, "edges_removed"), 0);
}

// As a 1DSfM data set without photographs and tracks; a twentieth of the poses is wrong.
TEST(Reconstruct, PosesWithoutMatchesGiveCamerasAlone) {
  SceneOptions options = SmallScene();
  options.num_images = 12;
  const SyntheticScene scene = MakeScene(options, 10);
  const Database full = MakeDatabase(scene);
  Database database(":memory:");
  for (Image image : scene.images) {
    Camera camera = scene.cameras.at(image.camera_id);
    camera.has_prior_focal_length = false;
    camera.camera_id = image.camera_id = image.image_id;
    database.WriteCamera(camera);
    database.WriteImage(image);
  }
  int num_pairs = 0;
  for (const image_pair_t pair_id : full.ReadTwoViewGeometryPairIds()) {
    TwoViewGeometry geometry = full.ReadTwoViewGeometry(pair_id).value();
    geometry.inlier_matches.clear();
    if (++num_pairs % 20 == 0) {
      geometry.cam2_from_cam1->rotation = Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitX());
    }
    database.WriteTwoViewGeometry(pair_id, geometry);
    WriteWinner(pair_id, kImportedVerifier, database);
  }
  ReconstructSettings settings;
  const ReconstructResult result = Reconstruct(database, "", settings, kOneThread);
  ASSERT_TRUE(result.report.Succeeded()) << ToJson(result.report);
  const Reconstruction& model = result.models.at(0);
  EXPECT_EQ(model.images.size(), 12u);
  EXPECT_TRUE(model.points3D.empty());
  const auto difference = CompareAligned(model, scene.truth);
  EXPECT_LT(difference.center, 1e-2 * Extent(scene.truth));
  EXPECT_LT(difference.angle, 1e-2);
  settings.view_graph.max_rotation_error_deg = 0;
  EXPECT_THAT(
      Reconstruct(database, "", settings, kOneThread).report.failure,
      AllOf(HasSubstr("edges: no edge agrees"), HasSubstr("--view_graph.max_rotation_error_deg")));
  const StageReport* agreement = FindStage(result.report, "agreement");
  ASSERT_NE(agreement, nullptr);
  EXPECT_EQ(Value(*agreement, "pairs"), num_pairs);
  const double share_right = 1.0 - num_pairs / 20 / static_cast<double>(num_pairs);
  EXPECT_NEAR(Value(*agreement, "rotation_within_5_deg"), share_right, 1e-9);
  EXPECT_EQ(FindStage(result.report, "focal_calibration"), nullptr);
  EXPECT_EQ(FindStage(result.report, "calibration_choice"), nullptr);
  EXPECT_EQ(FindStage(result.report, "triangulation"), nullptr);
  EXPECT_EQ(FindStage(result.report, "colors"), nullptr);  // nothing to color
}

TEST(Reconstruct, TwoImagesGiveAModel) {
  const SyntheticScene scene = MakeScene(SmallScene(), 9);
  Database database(":memory:");
  for (const auto& [id, camera] : scene.cameras) database.WriteCamera(camera);
  for (image_t id = 1; id <= 2; ++id) {
    database.WriteImage(scene.images[id - 1]);
    database.WriteKeypoints(id, scene.keypoints.at(id));
  }
  database.WriteTwoViewGeometry(ImagePairToPairId(1, 2),
                                TrueTwoViewGeometry(scene, 1, 2, MakeMatches(scene, 1, 2)));
  const ReconstructResult result = Reconstruct(database);
  ASSERT_TRUE(result.report.Succeeded()) << result.report.failure;
  EXPECT_EQ(result.models.at(0).images.size(), 2u);
}

}  // namespace
}  // namespace cairn
