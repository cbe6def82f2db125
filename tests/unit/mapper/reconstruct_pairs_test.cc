// Pairs that are wrong, tell little, or were verified by other intrinsics than a model finds.
#include <algorithm>

#include "cairn/base/rng.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/mapper/reconstruct.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "cairn/synthetic/scene.h"
#include "mapper/stages.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"
#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {
namespace {

// Image 10 keeps its matches but the poses of its pairs are lost.
TEST(Reconstruct, ImagesWithoutRelativePoseAreRegisteredByResection) {
  const SyntheticScene scene = MakeScene(SmallScene(), 7);
  Database database = MakeDatabase(scene);
  ChangeGeometries(database, [](image_t, image_t id2, TwoViewGeometry& geometry) {
    if (id2 == 10) MakePanoramic(geometry);
  });
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
  ChangeGeometries(database, [](image_t id1, image_t id2, TwoViewGeometry& geometry) {
    if ((id1 < 8) != (id2 < 8)) MakePanoramic(geometry);
  });
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
  ChangeGeometries(database, [](image_t, image_t id2, TwoViewGeometry& geometry) {
    if (id2 != 10) return;
    const Eigen::Quaterniond rotation = geometry.cam2_from_cam1->rotation;
    MakePanoramic(geometry);
    geometry.cam2_from_cam1 = Rigid3d(rotation, Eigen::Vector3d::Zero());
  });
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
  ChangeGeometries(database, [&](image_t id1, image_t id2, TwoViewGeometry& geometry) {
    if (!geometry.cam2_from_cam1) return;
    geometry.cam2_from_cam1 = wrong_pose(id2) * Inverse(wrong_pose(id1));
    geometry.E.reset();
  });
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
    ChangeGeometries(database, [&](image_t id1, image_t id2, TwoViewGeometry& geometry) {
      std::erase_if(geometry.inlier_matches, [&](const FeatureMatch& match) {
        return !is_central(id1, match.point1) || !is_central(id2, match.point2);
      });
    });
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
    // So does a model that goes on, whatever its lens is called.
    Reconstruction earlier = result.models[0];
    for (auto& [id, camera] : earlier.cameras) {
      if (camera.model != CameraModel::kSimpleRadial) continue;
      camera.model = CameraModel::kRadial;
      camera.params.push_back(0);
    }
    const ReconstructResult again =
        Reconstruct(database, "", {}, kOneThread, std::vector<Reconstruction>{earlier});
    ASSERT_EQ(again.models.size(), 1u);
    EXPECT_GT(again.models[0].NumObservations(), 0.99 * result.models[0].NumObservations());
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

TEST(Reconstruct, NamesImagesThatLieUpsideDown) {
  const SyntheticScene scene = MakeScene(SmallScene(), 7);
  Database database = MakeDatabase(scene);
  const auto warnings = [&] {
    const ReconstructResult result = Reconstruct(database);
    EXPECT_EQ(result.models.at(0).images.size(), 10u);
    std::vector<std::string> found;
    for (const ResultWarning& w : result.report.warnings) {
      if (w.what.find("upside down") != std::string::npos) found.push_back(w.what);
    }
    return found;
  };
  EXPECT_THAT(warnings(), IsEmpty());
  const Image &one = scene.images.at(3), &other = scene.images.at(8);
  const std::set<image_t> turned = {one.image_id, other.image_id};
  for (const image_t id : turned) {
    const Camera& camera = scene.cameras.at(one.camera_id);
    MoveKeypoints(scene, id, database, [&](const Eigen::Vector2d& pixel) -> Eigen::Vector2d {
      return Eigen::Vector2d(camera.width, camera.height) - pixel;
    });
  }
  const Rigid3d half_turn(Eigen::Quaterniond(0, 0, 0, 1), Eigen::Vector3d::Zero());
  ChangeGeometries(database, [&](image_t id1, image_t id2, TwoViewGeometry& geometry) {
    Rigid3d& pose = geometry.cam2_from_cam1.value();
    if (turned.contains(id1)) pose = pose * half_turn;
    if (turned.contains(id2)) pose = half_turn * pose;
    geometry.E = EssentialFromPose(pose);
  });
  EXPECT_THAT(warnings(), ElementsAre(HasSubstr("(2): " + one.name + ", " + other.name)));
}

TEST(Reconstruct, NamesImagesThatASmallPartHolds) {
  SceneOptions options = SmallScene();
  options.num_points = 4000;
  options.max_keypoints = 3000;
  const SyntheticScene scene = MakeScene(options, 3);
  Database database = MakeDatabase(scene);
  const auto has_warning = [&] {
    const ReconstructResult result = Reconstruct(database);
    EXPECT_EQ(result.models.front().images.size(), 10u);
    return std::ranges::any_of(result.report.warnings, [&](const ResultWarning& w) {
      return w.what.find("a small part of the photo") != std::string::npos &&
             w.what.ends_with("(1): " + scene.images.at(3).name);
    });
  };
  EXPECT_FALSE(has_warning());
  const image_t held = scene.images.at(3).image_id;
  const Camera& camera = scene.cameras.at(scene.images.at(3).camera_id);
  const auto is_outside = [&](point2D_t k) {
    const Keypoint& keypoint = scene.keypoints.at(held)[k];
    return std::max(std::abs(keypoint.x / camera.width - 0.5),
                    std::abs(keypoint.y / camera.height - 0.5)) > 0.1;
  };
  ChangeGeometries(database, [&](image_t id1, image_t id2, TwoViewGeometry& geometry) {
    if (id1 != held && id2 != held) return;
    std::erase_if(geometry.inlier_matches, [&](const FeatureMatch& match) {
      return is_outside(id1 == held ? match.point1 : match.point2);
    });
  });
  EXPECT_TRUE(has_warning());
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

}  // namespace
}  // namespace cairn
