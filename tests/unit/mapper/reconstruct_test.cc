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

double Extent(const Reconstruction& model) {
  double extent = 0;
  for (const auto& [id, image] : model.images) {
    extent = std::max(extent, (image.cam_from_world.Center() -
                               model.images.begin()->second.cam_from_world.Center())
                                  .norm());
  }
  return extent;
}

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
  // All edges and those with more and more inliers, by two or three powers, and two trees.
  const auto num_averaged = [&](double weight_power) {
    return value("rotation_averaging", "averaged", [=](auto& s) {
      s.view_graph.max_rotation_error_deg = 0.05;  // no rotations are clearly right
      s.rotation_averaging.weight_power = weight_power;
    });
  };
  EXPECT_GT(num_averaged(0), 2 * 2 + 2);
  EXPECT_EQ(num_averaged(0.5) - 2, (num_averaged(0) - 2) * 3 / 2);
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

// Calls the pairs of the last image panoramic, and changes their pose.
template <class Change>
void MakePanoramic(image_t last, Database& database, const Change& change_pose) {
  for (const image_pair_t pair_id : database.ReadTwoViewGeometryPairIds()) {
    if (PairIdToImagePair(pair_id).second != last) continue;
    TwoViewGeometry geometry = database.ReadTwoViewGeometry(pair_id).value();
    change_pose(geometry);
    geometry.E.reset();
    geometry.F.reset();
    geometry.config = TwoViewConfig::kPanoramic;
    database.WriteTwoViewGeometry(pair_id, geometry);
  }
}

// Image 10 keeps its matches but the poses of its pairs are lost.
TEST(Reconstruct, ImagesWithoutRelativePoseAreRegisteredByResection) {
  const SyntheticScene scene = MakeScene(SmallScene(), 7);
  Database database = MakeDatabase(scene);
  MakePanoramic(10, database, [](TwoViewGeometry& geometry) { geometry.cam2_from_cam1.reset(); });
  ReconstructSettings settings;
  settings.reconstruct.register_left_out = false;
  EXPECT_EQ(Reconstruct(database, settings).models.at(0).images.size(), 9u);
  const ReconstructResult result = Reconstruct(database);
  ASSERT_EQ(result.models.at(0).images.size(), 10u) << ToJson(result.report);
  EXPECT_LT(CompareAligned(result.models[0], scene.truth).center, 5e-3 * Extent(scene.truth));
}

// Images 8 to 10 are a component of their own, which matches join with the others.
TEST(Reconstruct, AnImageIsInOneModel) {
  const SyntheticScene scene = MakeScene(SmallScene(), 7);
  Database database = MakeDatabase(scene);
  for (const image_pair_t pair_id : database.ReadTwoViewGeometryPairIds()) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    if ((id1 < 8) == (id2 < 8)) continue;
    TwoViewGeometry geometry = database.ReadTwoViewGeometry(pair_id).value();
    geometry.cam2_from_cam1.reset();
    geometry.E = geometry.F = std::nullopt;
    geometry.config = TwoViewConfig::kPanoramic;
    database.WriteTwoViewGeometry(pair_id, geometry);
  }
  ReconstructSettings settings;
  settings.reconstruct.register_left_out = false;
  EXPECT_EQ(Reconstruct(database, settings).models.size(), 2u);
  const ReconstructResult result = Reconstruct(database);
  ASSERT_EQ(result.models.size(), 1u);
  EXPECT_EQ(result.models[0].images.size(), 10u);
  EXPECT_EQ(Value(*FindStage(result.report, "left_out"), "images"), 0);
}

// The model uses a pair by its matches, also one whose relative pose was wrong.
TEST(Reconstruct, PairsInUseHavePosesLikeThoseOfTheModel) {
  const SyntheticScene scene = MakeScene(SmallScene(), 1);
  Database database = MakeDatabase(scene);
  const image_pair_t wrong = database.ReadTwoViewGeometryPairIds().front();
  TwoViewGeometry geometry = *database.ReadTwoViewGeometry(wrong);
  geometry.cam2_from_cam1->rotation =
      ExpSO3(Eigen::Vector3d(0, 0.7, 0)) * geometry.cam2_from_cam1->rotation;
  geometry.E = geometry.F = std::nullopt;
  database.WriteTwoViewGeometry(wrong, geometry);
  const ReconstructResult result = Reconstruct(database);
  ASSERT_EQ(result.models.size(), 1u);
  const Reconstruction& model = result.models.front();
  bool uses_wrong = false;
  for (const ViewEdge& edge : result.graph.edges) {
    if (!edge.IsActive()) continue;
    uses_wrong |= edge.PairId() == wrong;
    const Rigid3d pose = model.images.at(edge.image_id2).cam_from_world *
                         Inverse(model.images.at(edge.image_id1).cam_from_world);
    EXPECT_LT(AngleBetween(pose.rotation, edge.cam2_from_cam1.rotation), 0.18)
        << edge.image_id1 << " " << edge.image_id2;
  }
  EXPECT_TRUE(uses_wrong);
}

// Frames of a stranger's keypoints that no float can square.
TEST(Reconstruct, HugeFramesHaveNoWeight) {
  const SyntheticScene scene = MakeScene(SmallScene(), 7);
  Database database = MakeDatabase(scene);
  for (image_t id = 1; id <= 10; ++id) {
    std::vector<Keypoint> keypoints = scene.keypoints.at(id);
    for (size_t k = 0; k < keypoints.size(); k += 4) {
      keypoints[k].a11 = 1e20f;
      keypoints[k].a12 = keypoints[k].a21 = 0;
      keypoints[k].a22 = k % 8 == 0 ? 1e20f : 1;
    }
    database.WriteKeypoints(id, keypoints);
  }
  const ReconstructResult result = Reconstruct(database);
  ASSERT_EQ(result.models.size(), 1u);
  ASSERT_EQ(result.models[0].images.size(), 10u);
  EXPECT_LT(CompareAligned(result.models[0], scene.truth).center, 5e-3 * Extent(scene.truth));
}

// All pairs of image 10 say only by how much it is turned: points give its position.
TEST(Reconstruct, PairsWithARotationAloneTakePart) {
  const SyntheticScene scene = MakeScene(SmallScene(), 7);
  Database database = MakeDatabase(scene);
  MakePanoramic(10, database,
                [](TwoViewGeometry& geometry) { geometry.cam2_from_cam1->translation.setZero(); });
  ReconstructSettings settings;
  settings.reconstruct.register_left_out = false;
  const ReconstructResult result = Reconstruct(database, settings);
  ASSERT_EQ(result.models.at(0).images.size(), 10u) << ToJson(result.report);
  EXPECT_LT(CompareAligned(result.models[0], scene.truth).center, 5e-3 * Extent(scene.truth));
}

// The pairs of images 9 and 10 with the others agree on wrong poses, and the pair of the two holds
// them there; their matches are right.
TEST(Reconstruct, MisplacedImagesAreRegisteredAnew) {
  SceneOptions options = SmallScene();
  options.pair_metrics = true;  // verified by us, so that the stored poses count
  const SyntheticScene scene = MakeScene(options, 7);
  Database database = MakeDatabase(scene);
  const Rigid3d turn(ExpSO3({0, 2, 0}), Eigen::Vector3d(0.5, 0, 0));
  const auto wrong_pose = [&](image_t id) {
    const Rigid3d& right = scene.truth.images.at(id).cam_from_world;
    return id < 9 ? right : right * turn;
  };
  for (const image_pair_t pair_id : database.ReadTwoViewGeometryPairIds()) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    TwoViewGeometry geometry = database.ReadTwoViewGeometry(pair_id).value();
    if (!geometry.cam2_from_cam1) continue;
    geometry.cam2_from_cam1 = wrong_pose(id2) * Inverse(wrong_pose(id1));
    geometry.E.reset();
    database.WriteTwoViewGeometry(pair_id, geometry);
  }
  const ReconstructResult result = Reconstruct(database);
  ASSERT_EQ(result.models.size(), 1u) << ToJson(result.report);
  ASSERT_EQ(result.models[0].images.size(), 10u);
  EXPECT_LT(CompareAligned(result.models[0], scene.truth).center, 5e-3 * Extent(scene.truth));
}

// Verified without knowing of the lens' distortion, pairs have inliers in the middle of the images
// alone; bundle adjustment finds the distortion, and the others come in. Of two cameras, that of
// one is known.
TEST(Reconstruct, PairsAreVerifiedAgainWhereIntrinsicsMoved) {
  for (const int num_cameras : {1, 2}) {
    SceneOptions options = SmallScene();
    options.num_cameras = num_cameras;
    options.camera_model = CameraModel::kSimpleRadial;
    options.radial_distortion = -0.15;
    const SyntheticScene scene = MakeScene(options, 12);
    Database database = MakeDatabase(scene);
    Camera unknown = scene.cameras.rbegin()->second;
    unknown.params.back() = 0;
    database.WriteCamera(unknown);
    const auto is_central = [&](image_t id, point2D_t point) {
      const Camera& camera = scene.cameras.at(scene.images[id - 1].camera_id);
      const Eigen::Vector2d offset =
          scene.keypoints.at(id)[point].Position() - camera.PrincipalPoint();
      return offset.norm() < 0.25 * camera.DiagonalPx();
    };
    for (const image_pair_t pair_id : database.ReadTwoViewGeometryPairIds()) {
      const auto [id1, id2] = PairIdToImagePair(pair_id);
      TwoViewGeometry geometry = database.ReadTwoViewGeometry(pair_id).value();
      std::erase_if(geometry.inlier_matches, [&, id1 = id1, id2 = id2](const FeatureMatch& match) {
        return !is_central(id1, match.point1) || !is_central(id2, match.point2);
      });
      database.WriteTwoViewGeometry(pair_id, geometry);
    }
    const ReconstructResult result = Reconstruct(database);
    ASSERT_EQ(result.models.size(), 1u) << ToJson(result.report);
    const StageReport* stage = FindStage(result.report, "verification");
    ASSERT_NE(stage, nullptr);
    EXPECT_GT(Value(*stage, "pairs"), 10);  // as many as join five photographs of one camera
    EXPECT_GT(Value(*stage, "matches_gained"), 100);
    int64_t num_outside = 0;
    for (const auto& [id, image] : result.models[0].images) {
      for (size_t k = 0; k < image.point3D_ids.size(); ++k) {
        num_outside +=
            image.point3D_ids[k] != kInvalidPoint3DId && !is_central(id, static_cast<point2D_t>(k));
      }
    }
    EXPECT_GT(num_outside, 100);
  }
}

// Of a video that stands still for more than half of its length: pairs of these frames have no
// pose.
TEST(Reconstruct, ManyFramesFromOnePlaceAreNoCollapse) {
  const SyntheticScene scene = MakeScene(SmallScene(), 3);
  Database database = MakeDatabase(scene);
  const image_t still = scene.images.at(3).image_id;
  const auto pairs = database.ReadTwoViewGeometryPairIds();
  Rng rng(1);
  for (image_t copy = 101; copy <= 112; ++copy) {
    database.WriteImage({copy, "still" + std::to_string(copy), scene.images.at(3).camera_id});
    std::vector<Keypoint> keypoints = scene.keypoints.at(still);
    for (Keypoint& keypoint : keypoints) {
      keypoint.x += static_cast<float>(0.1 * rng.Gaussian());
      keypoint.y += static_cast<float>(0.1 * rng.Gaussian());
    }
    database.WriteKeypoints(copy, keypoints);
    for (const image_pair_t pair_id : pairs) {
      const auto [id1, id2] = PairIdToImagePair(pair_id);
      if (id1 != still && id2 != still) continue;
      const TwoViewGeometry geometry = database.ReadTwoViewGeometry(pair_id).value();
      const image_t other = id1 == still ? id2 : id1;
      database.WriteTwoViewGeometry(ImagePairToPairId(other, copy),
                                    id1 == still ? Inverted(geometry) : geometry);
    }
  }
  const ReconstructResult result = Reconstruct(database);
  ASSERT_EQ(result.models.size(), 1u) << result.report.failure;
  EXPECT_EQ(result.models[0].images.size(), 22u);
}

// Where its pair is wrong, no other tells.
TEST(Reconstruct, NamesImagesThatASinglePairHolds) {
  const SyntheticScene scene = MakeScene(SmallScene(), 3);
  Database database = MakeDatabase(scene);
  const std::string warning =
      "held by one pair each, which no other confirms (1): " + scene.images.at(3).name;
  const auto has_warning = [&] {
    const ReconstructResult result = Reconstruct(database);
    EXPECT_EQ(result.models.front().images.size(), 10u);
    return std::ranges::any_of(result.report.warnings,
                               [&](const ResultWarning& w) { return w.what.ends_with(warning); });
  };
  EXPECT_FALSE(has_warning());
  const image_t held = scene.images.at(3).image_id;
  std::vector<image_pair_t> pairs;
  for (const image_pair_t pair_id : database.ReadTwoViewGeometryPairIds()) {
    const auto [id1, id2] = PairIdToImagePair(pair_id);
    if (id1 == held || id2 == held) pairs.push_back(pair_id);
  }
  ASSERT_GT(pairs.size(), 1u);
  std::ranges::sort(pairs, {}, [&](image_pair_t pair_id) {
    return database.ReadTwoViewGeometry(pair_id)->inlier_matches.size();
  });
  pairs.pop_back();
  for (const image_pair_t pair_id : pairs) database.DeletePairResults(pair_id);
  EXPECT_TRUE(has_warning());
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
    PairMetrics metrics;
    metrics.pair_id = pair_id;
    metrics.verifier = metrics.step = kImportedVerifier;
    metrics.is_winner = true;
    database.WritePairMetrics(metrics);
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
