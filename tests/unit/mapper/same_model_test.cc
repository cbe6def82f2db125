// Rough poses that refinement would take to a model that is there already.
#include <algorithm>

#include "cairn/math/so3.h"
#include "unit/mapper/incomplete_model.h"

namespace cairn {
namespace {

// The true model of a scene without an image, turned in another frame; each pose off by a little.
struct RoughModel : IncompleteModel {
  explicit RoughModel(double factor = 1, const SceneOptions& options = SmallScene())
      : IncompleteModel({3}, 1, options) {
    for (auto& [id, image] : model.images) {
      const Rigid3d error(ExpSO3({0, factor * 5e-4 * (id % 3), 0}), {factor * 1e-3, 0, 0});
      image.cam_from_world = error * image.cam_from_world;
    }
    model.Transform({2.5, ExpSO3({0.3, -1, 2}), {5, -3, 1}});
  }
  bool LeadsToTruth() const { return LeadsTo(context, truth, model); }
};

TEST(LeadsTo, PosesThatAreNearInAnyFrame) { EXPECT_TRUE(RoughModel().LeadsToTruth()); }

// Where triangulation takes errors in proportion.
TEST(LeadsTo, PosesThatAreNearInLargePhotographs) {
  SceneOptions options = SmallScene();
  options.image_width = 12800;
  options.image_height = 9600;
  EXPECT_TRUE(RoughModel(0.5, options).LeadsToTruth());
  EXPECT_FALSE(RoughModel(2.0, options).LeadsToTruth());
}

TEST(LeadsTo, NotWhereOneImageIsElsewhere) {
  RoughModel turned;
  RegisteredImage& image = turned.model.images.at(7);
  image.cam_from_world = Rigid3d(ExpSO3({0, 0.1, 0}), {0, 0, 0}) * image.cam_from_world;
  EXPECT_FALSE(turned.LeadsToTruth());

  RoughModel moved;
  Rigid3d& pose = moved.model.images.at(7).cam_from_world;
  pose.translation += Eigen::Vector3d(1, 0, 0);
  EXPECT_FALSE(moved.LeadsToTruth());
}

TEST(LeadsTo, NotWhereTheFinishedModelLacksAnImage) {
  RoughModel rough;
  RemoveImage(5, rough.truth);
  EXPECT_FALSE(rough.LeadsToTruth());
}

// Most pairs of two images, those of few inliers, have rotations that are wrong together; bundle
// adjustment starts from these and from right ones, and ends in one place.
struct TwoStarts : IncompleteModel {
  TwoStarts() : IncompleteModel({}) {
    std::vector<ViewEdge*> edges;
    for (ViewEdge& edge : graph.edges) {
      if ((edge.image_id1 > 8) != (edge.image_id2 > 8)) edges.push_back(&edge);
    }
    std::ranges::sort(edges, {}, [](const ViewEdge* edge) { return edge->num_inliers; });
    edges.resize(edges.size() * 2 / 3);
    for (ViewEdge* edge : edges) {
      Eigen::Quaterniond& rotation = edge->cam2_from_cam1.rotation;
      rotation = ExpSO3({0, 0.12, 0}) * rotation;
    }
  }
  void Build() {
    const BuiltModel built = BuildModel(context, graph.image_ids, graph);
    ASSERT_TRUE(built.model.has_value());
    EXPECT_EQ(Value(*FindStage(report, "rotation_averaging"), "hypotheses_out"), 2);
    EXPECT_EQ(std::ranges::count(report.stages, "checks", &StageReport::name), 1);
  }
};

TEST(BuildModel, DoesNotFinishWhatLeadsToTheModelThatIsThere) {
  TwoStarts scene;
  for (auto& [pair_id, matches] : scene.scene.matches) {  // that no model explains
    for (size_t i = 0; i + 1 < matches.size(); i += 60) {
      std::swap(matches[i].point2, matches[i + 1].point2);
    }
  }
  scene.Build();
  ASSERT_NE(FindStage(scene.report, "comparison"), nullptr);
  EXPECT_EQ(Value(*FindStage(scene.report, "comparison"), "finds_best_again"), 1);
}

TEST(BuildModel, DoesNotBeginAnotherWhereOneExplainsAllMatches) {
  TwoStarts scene;
  scene.Build();
  EXPECT_EQ(std::ranges::count(scene.report.stages, "translation_averaging", &StageReport::name),
            1);
}

}  // namespace
}  // namespace cairn
