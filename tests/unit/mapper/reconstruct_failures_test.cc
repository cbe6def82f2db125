// What a run that cannot go on, or was stopped, says, and models that are refused.
#include <limits>

#include "cairn/base/rng.h"
#include "cairn/mapper/reconstruct.h"
#include "cairn/math/so3.h"
#include "cairn/synthetic/poses.h"
#include "cairn/synthetic/scene.h"
#include "database/stage_names.h"
#include "mapper/stages.h"
#include "support/synthetic_reconstruction.h"
#include "support/test.h"
#include "unit/mapper/reconstruct_fixture.h"

namespace cairn {
namespace {

// Asks to stop when it was asked so often.
class StopsAfter : public ProgressMonitor {
 public:
  explicit StopsAfter(int num_questions) : num_questions_(num_questions) {}
  void Warning(const std::string& message) override { warnings.push_back(message); }
  bool StopRequested() const override { return ++num_asked > num_questions_; }

  mutable int num_asked = 0;
  std::vector<std::string> warnings;

 private:
  const int num_questions_;
};

TEST(Reconstruct, AStoppedRunSaysSoWhereverItStops) {
  const Database database = MakeDatabase(MakeScene(SmallScene(), 10));
  StopsAfter never(std::numeric_limits<int>::max());
  Reconstruct(database, "", {}, {.num_threads = 1, .monitor = never});
  ASSERT_GT(never.num_asked, 20);
  for (int k = 0; k < never.num_asked; k += never.num_asked / 10) {
    StopsAfter monitor(k);
    const ReconstructResult result =
        Reconstruct(database, "", {}, {.num_threads = 1, .monitor = monitor});
    EXPECT_THAT(result.report.failure, StartsWith("stopped by the user")) << k;
    EXPECT_THAT(monitor.warnings, IsEmpty()) << k;
  }
}

TEST(Reconstruct, PairsThatWaitForVerificationAreAWarning) {
  Database database = MakeDatabase(MakeScene(SmallScene(), 10));
  database.WriteMatches(ImagePairToPairId(1, 99), {});  // of an image that is not there
  for (image_t id = 2; id <= 4; ++id) {
    database.WritePairChoice({ImagePairToPairId(1, id), 0, "exhaustive"});
  }
  EXPECT_THAT(Reconstruct(database).report.warnings, IsEmpty());
  database.DeletePairResults(ImagePairToPairId(1, 2));
  database.DeletePairResults(ImagePairToPairId(1, 5));
  database.WriteMatches(ImagePairToPairId(1, 5), {{0, 0}});
  database.WriteJob(kStageFeatures, {1, 0, ""});
  // Three that nothing can verify: of an image without keypoints, of one with some that are not
  // finite, and with matches of others than are there.
  database.WriteImage({97, "none.jpg", 1});
  database.WriteImage({98, "damaged.jpg", 1});
  database.WriteKeypoints(98, {{std::numeric_limits<float>::quiet_NaN(), 0}});
  for (const image_t id : {97, 98}) database.WriteMatches(ImagePairToPairId(1, id), {{0, 0}});
  database.DeletePairResults(ImagePairToPairId(1, 6));
  database.WriteMatches(ImagePairToPairId(1, 6), {{1U << 30, 0}});
  const std::vector<ResultWarning> warnings = Reconstruct(database).report.warnings;
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_THAT(warnings[0].what, HasSubstr("2 pairs"));
  EXPECT_THAT(warnings[0].advice, HasSubstr("build_view_graph"));
}

TEST(Reconstruct, PairsWhoseKeypointsAreGoneAreAWarning) {
  Database database = MakeDatabase(MakeScene(SmallScene(), 10));
  std::vector<Keypoint> keypoints = *database.ReadKeypoints(1);
  keypoints.resize(5);
  database.WriteKeypoints(1, keypoints);
  const ResultWarning warning = Reconstruct(database).report.warnings.at(0);
  EXPECT_THAT(warning.what, HasSubstr(" pairs are left out, since their rows in the database"));
}

TEST(Reconstruct, SaysWhatIsMissing) {
  Database empty(":memory:");
  const ReconstructResult nothing = Reconstruct(empty);
  EXPECT_TRUE(nothing.models.empty());
  EXPECT_THAT(nothing.report.failure, HasSubstr("no image with keypoints"));
  Database without_features(":memory:");
  Camera camera = Camera::FromFocal(1, CameraModel::kPinhole, 800, 640, 480);
  without_features.WriteCamera(camera);
  without_features.WriteImage({1, "a.jpg", 1});
  EXPECT_THAT(Reconstruct(without_features).report.failure, HasSubstr("no image with keypoints"));
  camera.params[0] = -1;
  without_features.WriteCamera(camera);
  EXPECT_THAT(Reconstruct(without_features).report.failure,
              HasSubstr("no image that can be used; look at the warnings above"));

  const SyntheticScene scene = MakeScene(SmallScene(), 8);
  Database unverified(":memory:");
  WriteScene(scene, SceneContent::kMatches, unverified);
  EXPECT_THAT(Reconstruct(unverified).report.failure, HasSubstr("no verified pair"));

  ReconstructSettings settings;
  settings.view_graph.min_num_inliers = 100000;
  const ReconstructResult weak = Reconstruct(MakeDatabase(scene), settings);
  EXPECT_THAT(weak.report.failure, HasSubstr("view_graph: "));
  ASSERT_FALSE(weak.graph.edges.empty());
  EXPECT_EQ(weak.graph.edges[0].removal, EdgeRemoval::kTooFewInliers);
}

// What each stage says that cannot go on: its name, what was there, what to try.
TEST(Reconstruct, SaysWhichStageFailedAndWhatToTry) {
  const SyntheticScene scene = MakeScene(SmallScene(), 8);
  const auto failure_of = [](const Database& database, const ReconstructSettings& settings) {
    const ReconstructResult result = Reconstruct(database, settings);
    EXPECT_TRUE(result.models.empty());
    EXPECT_FALSE(result.graph.edges.empty());
    return result.report.failure;
  };
  {
    // Every pair turned at random: the loops leave a tree, and that no positions.
    Database database = MakeDatabase(scene);
    Rng rng(1);
    ChangeGeometries(database, [&](image_t id1, image_t id2, TwoViewGeometry& geometry) {
      geometry.cam2_from_cam1->rotation = RandomRotation(rng);
      WriteWinner(ImagePairToPairId(id1, id2), "test", database);
    });
    EXPECT_THAT(
        failure_of(database, {}),
        AllOf(HasSubstr("translation_averaging: inconsistent: "), HasSubstr(" directions, "),
              HasSubstr("--translation_averaging.filter_max_inconsistency")));
  }
  {
    // All pairs are pure rotations.
    Database database = MakeDatabase(scene);
    ChangeGeometries(database, [](image_t, image_t, TwoViewGeometry& g) { MakePanoramic(g); });
    EXPECT_THAT(failure_of(database, {}),
                AllOf(HasSubstr(" no_pose"), HasSubstr("turned without moving")));
  }
  {
    // COLMAP of 2017 stored matches alone.
    Database database = MakeDatabase(scene);
    ChangeGeometries(database, [](image_t, image_t, TwoViewGeometry& geometry) {
      geometry = {TwoViewConfig::kCalibrated, {}, {}, {}, {}, geometry.inlier_matches};
    });
    EXPECT_THAT(failure_of(database, {}),
                AllOf(HasSubstr(" no_pose"), HasSubstr("--recompute verification")));
  }
}

TEST(ReasonToRefuse, KnowsCollapsedModels) {
  MadeReconstruction scene = MakeSyntheticScene({});
  EXPECT_EQ(ReasonToRefuse(scene.truth), "");
  Reconstruction collapsed = scene.truth;
  for (auto& [id, image] : collapsed.images) {
    if (id > 1)
      image.cam_from_world.translation = image.cam_from_world.rotation * Eigen::Vector3d(0, 0, 5);
  }
  // A tripod, and one photograph from elsewhere: enough to see depth.
  EXPECT_EQ(ReasonToRefuse(collapsed), "");
  RegisteredImage& first = collapsed.images.begin()->second;
  first.cam_from_world.translation = first.cam_from_world.rotation * Eigen::Vector3d(0, 0, 5);
  EXPECT_THAT(ReasonToRefuse(collapsed), HasSubstr("collapsed"));
  Reconstruction far = scene.truth;
  for (auto& [id, point] : far.points3D) point.xyz *= 1e5;
  EXPECT_THAT(ReasonToRefuse(far), HasSubstr("collapsed"));
  Reconstruction poor = scene.truth;
  while (poor.points3D.size() > 10) poor.RemovePoint3D(poor.points3D.begin()->first);
  EXPECT_THAT(ReasonToRefuse(poor), HasSubstr("only 10 points"));
  while (poor.images.size() > 1) poor.images.erase(poor.images.begin());
  EXPECT_EQ(ReasonToRefuse(poor), "only one image has a pose");
  EXPECT_EQ(ReasonToRefuse({}), "no image has a pose");
}

}  // namespace
}  // namespace cairn
