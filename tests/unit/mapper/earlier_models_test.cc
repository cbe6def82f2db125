// Reconstruction that goes on from models that are there.
#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "math/random_vectors.h"
#include "support/check_consistency.h"
#include "support/test.h"
#include "support/test_monitor.h"
#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {
namespace {

ReconstructResult Continue(const Database& database, const std::vector<Reconstruction>& earlier,
                           const ReconstructSettings& settings = {}) {
  return Reconstruct(database, "", settings, kOneThread, earlier);
}

std::vector<std::string> WarningsOf(const ReconstructResult& result) {
  std::vector<std::string> texts;
  for (const ResultWarning& warning : result.report.warnings) texts.push_back(warning.what);
  return texts;
}

std::set<std::string> NamesOf(const Reconstruction& model) {
  std::set<std::string> names;
  for (const auto& [id, image] : model.images) names.insert(image.image.name);
  return names;
}

// A scene of twelve images, and a model of nine of them in a frame of its own.
class EarlierModelsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    SceneOptions options = SmallScene();
    options.num_images = 12;
    options.num_cameras = 1;
    scene_ = MakeScene(options, 3);
    database_ = MakeDatabase(scene_);
    Database before = MakeDatabase(scene_);
    before.DeleteImagesAndPairs({4, 8, 12});
    const ReconstructResult result = Reconstruct(before);
    ASSERT_EQ(result.models.size(), 1u);
    model_ = result.models.front();
    ASSERT_EQ(model_.images.size(), 9u);
    Sim3d frame;
    frame.scale = 7;
    frame.rotation = Eigen::Quaterniond(0.5, 0.1, -0.7, 0.3).normalized();
    frame.translation = {1000, -200, 30};
    model_.Transform(frame);
  }

  // The largest move of an image of the earlier model, in extents of it.
  double LargestMove(const Reconstruction& model) const { return LargestMoveBut(0, model); }
  double LargestMoveBut(image_t left_out, const Reconstruction& model) const {
    double move = 0, extent = 0;
    const Eigen::Vector3d first = model_.images.begin()->second.cam_from_world.Center();
    for (const auto& [id, image] : model_.images) {
      const Eigen::Vector3d center = image.cam_from_world.Center();
      extent = std::max(extent, (center - first).norm());
      if (id == left_out) continue;
      move = std::max(move, (model.images.at(id).cam_from_world.Center() - center).norm());
    }
    return move / extent;
  }

  SyntheticScene scene_;
  Database database_{":memory:"};
  Reconstruction model_;
};

TEST_F(EarlierModelsTest, RegisterNewImagesAndStayWhereTheyAre) {
  const ReconstructResult result = Continue(database_, {model_});
  ASSERT_TRUE(result.report.Succeeded()) << result.report.failure;
  ASSERT_EQ(result.models.size(), 1u);
  const Reconstruction& model = result.models.front();
  CheckConsistency(model);
  EXPECT_EQ(model.images.size(), 12u);
  const auto difference = CompareAligned(model, scene_.truth);
  EXPECT_LT(difference.angle, 2e-3);
  EXPECT_LT(LargestMove(model), 2e-3);
  const StageReport* input = FindStage(result.report, "input");
  ASSERT_NE(input, nullptr);
  EXPECT_EQ(Value(*input, "images"), 9);
  EXPECT_EQ(Value(*input, "images_to_register"), 3);
  // Nothing is averaged.
  EXPECT_EQ(FindStage(result.report, "rotation_averaging"), nullptr);
  EXPECT_EQ(FindStage(result.report, "translation_averaging"), nullptr);
}

// Photographs that were replaced by others of the same names: 4 and 8 are now where 1 and 2 were.
TEST_F(EarlierModelsTest, ReplacedPhotographsAreRegisteredAnew) {
  for (const auto& [replaced, other] : {std::pair(1, 4), std::pair(2, 8)}) {
    RegisteredImage& image = model_.images.at(replaced);
    image.points2D = scene_.truth.images.at(other).points2D;
    image.point3D_ids.assign(image.points2D.size(), kInvalidPoint3DId);
    // Its place is that of the photograph before: anywhere.
    image.cam_from_world.translation += Eigen::Vector3d(900, -700, 400);
  }
  const ReconstructResult result = Continue(database_, {model_});
  ASSERT_EQ(result.models.size(), 1u) << result.report.failure;
  EXPECT_EQ(Value(*FindStage(result.report, "input"), "images"), 7);
  EXPECT_EQ(result.models.front().images.size(), 12u);
  EXPECT_LT(CompareAligned(result.models.front(), scene_.truth).angle, 2e-3);
  // Of another lens, threshold or program the keypoints of all are others, and poses are right.
  for (auto& [id, image] : model_.images) {
    image.points2D.pop_back();
    image.point3D_ids.pop_back();
  }
  EXPECT_EQ(Value(*FindStage(Continue(database_, {model_}).report, "input"), "images"), 9);
  // However many photographs the database has by now.
  for (const image_t id : {3, 5, 6, 7, 9}) model_.images.erase(id);
  EXPECT_EQ(Value(*FindStage(Continue(database_, {model_}).report, "input"), "images"), 4);
}

TEST_F(EarlierModelsTest, AreRefinedAloneWhereNothingIsRegistered) {
  Rng rng(1);
  for (auto& [id, image] : model_.images) {
    image.cam_from_world.translation.head<2>() += 0.02 * GaussianVector<2>(rng);
  }
  ReconstructSettings settings;
  settings.reconstruct.register_left_out = false;
  const ReconstructResult result = Continue(database_, {model_}, settings);
  ASSERT_EQ(result.models.size(), 1u) << result.report.failure;
  EXPECT_EQ(NamesOf(result.models.front()), NamesOf(model_));
  const auto difference = CompareAligned(result.models.front(), scene_.truth);
  EXPECT_LT(difference.angle, 2e-3);
}

TEST_F(EarlierModelsTest, APanoramaForAPhotographIsNoModel) {
  for (auto& [id, camera] : model_.cameras) {
    camera.params = {static_cast<double>(camera.width), static_cast<double>(camera.height)};
    camera.model = CameraModel::kEquirectangular;
  }
  const ReconstructResult result = Continue(database_, {model_});
  EXPECT_TRUE(result.report.Succeeded()) << result.report.failure;
}

// Another program numbers images, cameras and keypoints as it likes.
TEST_F(EarlierModelsTest, AreToldByNameAndBringTheirCameras) {
  Reconstruction other;
  Camera camera = model_.cameras.begin()->second;
  const double focal_px = camera.MeanFocal();
  for (const auto& [id, image] : model_.images) {
    RegisteredImage& copy = other.images[1000 - id] = image;
    copy.image.image_id = 1000 - id;
    copy.image.camera_id = 70 + id;
    copy.points2D.clear();
    copy.point3D_ids.clear();
  }
  for (const auto& [id, image] : model_.images) {  // equal ones
    camera.camera_id = 70 + id;
    other.cameras[camera.camera_id] = camera;
  }
  // In the database, images that share it have two, with wrong focal lengths.
  Camera stored = scene_.cameras.begin()->second;
  stored.SetMeanFocal(1.5 * focal_px);
  for (const camera_t id : {1, 2}) {
    stored.camera_id = id;
    database_.WriteCamera(stored);
  }
  for (const image_t id : {2, 4}) database_.WriteImage({id, scene_.images[id - 1].name, 2});
  other.images.at(998).image.camera_id = 71;  // image 2 has the camera of image 1
  other.cameras.erase(72);
  ReconstructSettings settings;
  settings.refine_intrinsics = false;
  const ReconstructResult result = Continue(database_, {other}, settings);
  ASSERT_EQ(result.models.size(), 1u) << result.report.failure;
  const Reconstruction& model = result.models.front();
  EXPECT_EQ(model.images.size(), 12u);
  ASSERT_EQ(model.cameras.size(), 1u);
  EXPECT_EQ(model.cameras.at(1).MeanFocal(), focal_px);
  EXPECT_LT(LargestMove(model), 2e-3);
  EXPECT_EQ(Value(*FindStage(result.report, "input"), "images_other_keypoints"), 9);
}

TEST_F(EarlierModelsTest, ImagesThatTheDatabaseLacksAreNamedAndLeftOut) {
  database_.DeleteImagesAndPairs({2});
  const ReconstructResult result = Continue(database_, {model_});
  ASSERT_EQ(result.models.size(), 1u) << result.report.failure;
  EXPECT_EQ(result.models.front().images.size(), 11u);
  EXPECT_THAT(WarningsOf(result),
              Contains(AllOf(HasSubstr("1 images of the input model that are not in the database"),
                             HasSubstr(scene_.images[1].name))));
}

TEST_F(EarlierModelsTest, OfOtherPhotographsAreRefused) {
  for (auto& [id, image] : model_.images) image.image.name = "other/" + image.image.name;
  const ReconstructResult result = Continue(database_, {model_});
  EXPECT_TRUE(result.models.empty());
  EXPECT_THAT(result.report.failure, HasSubstr("fewer than two images of the input model"));
  EXPECT_GT(result.graph.NumActiveEdges(), 10);  // which do not go with it
}

TEST_F(EarlierModelsTest, OfAnotherSizeAreRefused) {
  for (auto& [id, camera] : model_.cameras) camera.width /= 2;
  const ReconstructResult result = Continue(database_, {model_});
  EXPECT_TRUE(result.models.empty());
  EXPECT_THAT(WarningsOf(result), Contains(HasSubstr("of another size")));
}

// Of an image in two models the larger one keeps it; each goes on in its own frame.
TEST_F(EarlierModelsTest, SeveralGoOnSideBySide) {
  Reconstruction small = model_;
  for (auto it = small.images.begin(); it != small.images.end();) {
    it = it->first > 4 ? small.images.erase(it) : std::next(it);
  }
  Reconstruction large = model_;
  large.images.erase(1);
  large.images.erase(2);
  const ReconstructResult result = Continue(database_, {small, large});
  ASSERT_EQ(result.models.size(), 2u) << result.report.failure;
  EXPECT_EQ(result.models[0].images.size(), 10u);  // 3 and all that is new
  EXPECT_EQ(NamesOf(result.models[1]), NamesOf([&] {
              Reconstruction two = small;
              two.images.erase(3);
              return two;
            }()));
  EXPECT_THAT(WarningsOf(result), Contains(HasSubstr("that a larger model has")));
  EXPECT_THAT(WarningsOf(result),
              Contains(HasSubstr("verified pairs join models that stay apart")));
  for (const ViewEdge& edge : result.graph.edges) {
    const auto has_both = [&](const Reconstruction& model) {
      return model.images.count(edge.image_id1) > 0 && model.images.count(edge.image_id2) > 0;
    };
    EXPECT_TRUE(!edge.IsActive() || std::ranges::any_of(result.models, has_both));
  }
}

TEST_F(EarlierModelsTest, AnImageAloneInItsModelIsRegisteredLikeNewOnes) {
  Reconstruction large = model_, alone = model_;
  large.images.erase(1);
  std::erase_if(alone.images, [](const auto& image) { return image.first != 1; });
  const ReconstructResult result = Continue(database_, {alone, large});
  ASSERT_EQ(result.models.size(), 1u) << result.report.failure;
  EXPECT_EQ(result.models.front().images.size(), 12u);
  EXPECT_EQ(Value(*FindStage(result.report, "input"), "images"), 8);
  EXPECT_THAT(WarningsOf(result), Contains(HasSubstr("that are alone in their model")));
}

// A pose that was wrong is found, moved, and named.
TEST_F(EarlierModelsTest, PosesThatMoveByMoreThanTheirConfidenceAreNamed) {
  const ReconstructResult right = Continue(database_, {model_});
  const StageReport* movement = FindStage(right.report, "movement");
  ASSERT_NE(movement, nullptr);
  EXPECT_EQ(Value(*movement, "images"), 9);
  EXPECT_LT(Value(*movement, "median_sigmas"), 1.0);
  EXPECT_LT(Value(*movement, "largest_sigmas"), 3.0);
  RegisteredImage& wrong = model_.images.at(6);
  const Rigid3d pose = wrong.cam_from_world;
  wrong.cam_from_world.translation.x() += 0.1;
  const ReconstructResult moved = Continue(database_, {model_});
  EXPECT_GT(Value(*FindStage(moved.report, "movement"), "largest_sigmas"), 3.0);
  EXPECT_THAT(WarningsOf(moved),
              Contains(AllOf(HasSubstr("moved by more"), HasSubstr(wrong.image.name))));
  wrong.cam_from_world = pose;
  wrong.cam_from_world.translation.x() += 3;
  const ReconstructResult replaced = Continue(database_, {model_});
  EXPECT_THAT(WarningsOf(replaced),
              Contains(AllOf(HasSubstr("found anew"), HasSubstr(wrong.image.name))));
  EXPECT_LT(LargestMoveBut(6, replaced.models.at(0)), 2e-3);
}

// However wrong some poses are, the others tell the frame.
TEST_F(EarlierModelsTest, WrongPosesDoNotMoveTheFrame) {
  for (const double shift : {3.0, 1e15, 1e200}) {
    Reconstruction earlier = model_;
    for (const image_t id : {5, 6, 7}) {
      earlier.images.at(id).cam_from_world.translation += shift * Eigen::Vector3d(id, 2, 1);
    }
    const ReconstructResult result = Continue(database_, {earlier});
    ASSERT_EQ(result.models.size(), 1u) << result.report.failure;
    for (const auto& [id, image] : result.models[0].images) {
      if (id >= 5 && id <= 7) continue;
      const auto before = earlier.images.find(id);
      if (before == earlier.images.end()) continue;
      const Eigen::Vector3d center = before->second.cam_from_world.Center();
      EXPECT_LT((image.cam_from_world.Center() - center).norm(), 2e-3) << shift << " " << id;
    }
  }
}

// Nothing of it holds: its images are as without it.
TEST_F(EarlierModelsTest, AWrongModelIsGivenUpAndItsImagesAreReconstructed) {
  Rng rng(5);
  for (auto& [id, image] : model_.images) {
    const Eigen::Vector3d turn = GaussianVector<3>(rng);
    image.cam_from_world.rotation = ExpSO3(0.1 * turn) * image.cam_from_world.rotation;
  }
  const ReconstructResult result = Continue(database_, {model_});
  ASSERT_EQ(result.models.size(), 1u) << result.report.failure;
  EXPECT_EQ(result.models[0].images.size(), 12u);
  EXPECT_THAT(WarningsOf(result), Contains(HasSubstr("was given up")));
  EXPECT_EQ(result.keeps_frame, std::vector<bool>{false});
  EXPECT_TRUE(result.report.Succeeded());
}

TEST_F(EarlierModelsTest, GiveEqualBytesForAnyNumberOfThreads) {
  const std::vector<Reconstruction> earlier{model_};
  const ReconstructResult two = Reconstruct(database_, "", {}, {.num_threads = 2}, earlier);
  ExpectEqual(two.models.at(0), Continue(database_, earlier).models.at(0));
}

}  // namespace
}  // namespace cairn
