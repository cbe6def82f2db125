// Images that averaging left out, registered from the points of a model.
#include "cairn/base/rng.h"
#include "cairn/math/so3.h"
#include "support/check_consistency.h"
#include "support/test.h"
#include "unit/mapper/incomplete_model.h"

namespace cairn {
namespace {

TEST(RegisterLeftOut, GivesImagesTheirPoses) {
  for (const uint64_t seed : {1, 2, 3}) {
    IncompleteModel incomplete({3, 7}, seed);
    ASSERT_EQ(incomplete.model.images.size(), 8u);
    const auto num_points = incomplete.model.points3D.size();
    EXPECT_EQ(incomplete.Register(), 2);
    CheckConsistency(incomplete.model);
    ASSERT_EQ(incomplete.model.images.size(), 10u);
    EXPECT_EQ(incomplete.model.points3D.size(), num_points);
    for (const image_t id : {3, 7}) {
      // Three units from points that are known to 0.3 of about 1200 pixels.
      EXPECT_LT(incomplete.RotationErrorDeg(id), 0.1);
      EXPECT_LT(incomplete.CenterError(id), 0.01);
      EXPECT_EQ(incomplete.model.images.at(id).points2D, incomplete.scene.pixels.at(id));
    }
    const StageReport* stage = FindStage(incomplete.report, "registration");
    ASSERT_NE(stage, nullptr);
    EXPECT_EQ(Value(*stage, "candidates"), 2);
    EXPECT_EQ(Value(*stage, "registered"), 2);
    EXPECT_EQ(incomplete.Register(), 0);
  }
}

TEST(RegisterLeftOut, ImagesWithTooFewPointsOrInliersStayOut) {
  const auto registers = [](const auto& change) {
    IncompleteModel incomplete({5});
    change(incomplete.settings.resection);
    return incomplete.Register();
  };
  EXPECT_EQ(registers([](ResectionOptions&) {}), 1);
  EXPECT_EQ(registers([](ResectionOptions& options) { options.min_num_inliers = 100000; }), 0);
  EXPECT_EQ(registers([](ResectionOptions& options) { options.max_error_px = 1e-3; }), 0);
}

// An image that resection brought in has pairs that averaging had cut off.
TEST(ReviseEdges, PairsThatTheModelContradictsAreOutWhateverTheyWere) {
  IncompleteModel incomplete({});
  Rigid3d& pose = incomplete.model.images.at(3).cam_from_world;
  pose.rotation = ExpSO3(Eigen::Vector3d(0, 0.5, 0)) * pose.rotation;
  for (ViewEdge& edge : incomplete.graph.edges) {
    if (edge.image_id1 == 3) edge.removal = EdgeRemoval::kOtherComponent;
  }
  const ModelEvidence evidence =
      EvidenceFor(incomplete.context, incomplete.model, incomplete.graph);
  ReviseEdges(evidence, incomplete.model, incomplete.graph);
  int num_contradicted = 0;
  for (size_t e = 0; e < incomplete.graph.edges.size(); ++e) {
    const ViewEdge& edge = incomplete.graph.edges[e];
    if (edge.image_id1 != 3 || !evidence.pairs[e].IsContradicted()) continue;
    ++num_contradicted;
    EXPECT_EQ(edge.removal, EdgeRemoval::kModelInconsistent);
  }
  EXPECT_GT(num_contradicted, 2);
}

// A wrong guess of a focal length is found with the pose; a known one is not touched.
TEST(RegisterLeftOut, FindsAFocalLengthThatIsOnlyAGuess) {
  for (const bool is_known : {false, true}) {
    IncompleteModel incomplete({5});
    const camera_t camera_id = incomplete.scene.images.at(5).camera_id;
    Camera& camera = incomplete.scene.cameras.at(camera_id);
    const double focal_px = camera.MeanFocal();
    camera.SetMeanFocal(1.3 * focal_px);
    camera.has_prior_focal_length = is_known;
    ASSERT_EQ(incomplete.Register(), 1);
    const double found_px = incomplete.model.cameras.at(camera_id).MeanFocal();
    EXPECT_NEAR(found_px / focal_px, is_known ? 1.3 : 1.0, is_known ? 1e-12 : 0.02);
  }
}

// Poses are found in parallel, but for images of one camera that the model lacks.
TEST(RegisterLeftOut, TheFirstImageOfACameraMakesItKnownToTheOthers) {
  const auto make = [](IncompleteModel& incomplete) {
    const camera_t camera_id = incomplete.scene.images.at(3).camera_id;
    incomplete.scene.images.at(7).camera_id = camera_id;
    Camera& camera = incomplete.scene.cameras.at(camera_id);
    camera.SetMeanFocal(1.3 * camera.MeanFocal());
    camera.has_prior_focal_length = false;
    return camera_id;
  };
  IncompleteModel both({3, 7});
  const camera_t camera_id = make(both);
  ASSERT_EQ(both.Register(), 2);
  int num_alone = 0;
  for (const image_t first : {3, 7}) {
    IncompleteModel alone({3, 7});
    make(alone);
    alone.context.taken = {static_cast<image_t>(10 - first)};
    ASSERT_EQ(alone.Register(), 1);
    if (alone.model.cameras.at(camera_id).params != both.model.cameras.at(camera_id).params) {
      continue;
    }
    alone.context.taken.clear();
    ASSERT_EQ(alone.Register(), 1);
    for (const image_t id : {3, 7}) {
      EXPECT_EQ(alone.model.images.at(id).cam_from_world.translation,
                both.model.images.at(id).cam_from_world.translation);
    }
    ++num_alone;
  }
  EXPECT_EQ(num_alone, 1);
}

TEST(RegisterLeftOut, PairsOfAnotherPlaceDoNotCount) {
  IncompleteModel incomplete({3, 7});
  int num_ambiguous = 0;
  for (ViewEdge& edge : incomplete.graph.edges) {
    if (edge.image_id1 != 3 && edge.image_id2 != 3) continue;
    edge.removal = EdgeRemoval::kAmbiguous;
    ++num_ambiguous;
  }
  ASSERT_GT(num_ambiguous, 3);
  EXPECT_EQ(incomplete.Register(), 1);
  EXPECT_EQ(incomplete.model.images.count(3), 0u);
  // Other reasons to leave a pair out say nothing against its matches.
  for (ViewEdge& edge : incomplete.graph.edges) {
    if (!edge.IsActive()) edge.removal = EdgeRemoval::kRotationInconsistent;
  }
  EXPECT_EQ(incomplete.Register(), 1);
}

TEST(RegisterLeftOut, ImagesOfOtherModelsStayThere) {
  IncompleteModel incomplete({3, 7});
  incomplete.context.taken = {3};
  incomplete.context.reserved = {7};
  EXPECT_EQ(incomplete.Register(), 0);
  incomplete.context.reserved.clear();
  EXPECT_EQ(incomplete.Register(), 1);
  EXPECT_EQ(incomplete.model.images.count(7), 1u);
}

TEST(RegisterLeftOut, WrongMatchesGiveNoPose) {
  IncompleteModel incomplete({3});
  Rng rng(1);
  rng.Shuffle(incomplete.scene.pixels.at(3));
  EXPECT_EQ(incomplete.Register(), 0);
  EXPECT_EQ(incomplete.model.images.count(3), 0u);
  const StageReport* stage = FindStage(incomplete.report, "registration");
  ASSERT_NE(stage, nullptr);
  EXPECT_EQ(Value(*stage, "candidates"), 1);
  ASSERT_EQ(stage->messages.size(), 1u);
  EXPECT_THAT(stage->messages[0], HasSubstr("not registered"));
}

}  // namespace
}  // namespace cairn
