// Cameras around a thing that looks alike from several sides: most pairs agree on one side.
#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

constexpr int kNumImages = 36;
constexpr int kPeriod = 12;  // the thing looks alike from every 12th image
constexpr int kReach = 2;    // neighbors see the same

Eigen::Quaterniond CameraAt(int steps) {
  return ExpSO3({0, 2 * std::numbers::pi * steps / kNumImages, 0});
}

// The steps from -period / 2 to period / 2 that lead as far around.
int Wrapped(int steps, int period) {
  return ((steps + period / 2) % period + period) % period - period / 2;
}

ViewGraph LooksAlike(int num_inliers, int num_inliers_of_neighbors) {
  ViewGraph graph;
  for (int i = 0; i < kNumImages; ++i) {
    graph.image_ids.push_back(static_cast<image_t>(i + 1));
    for (int j = i + 1; j < kNumImages; ++j) {
      const bool are_neighbors = std::abs(Wrapped(j - i, kNumImages)) <= kReach;
      const int steps = Wrapped(j - i, are_neighbors ? kNumImages : kPeriod);
      if (std::abs(steps) > kReach) continue;
      ViewEdge edge;
      edge.image_id1 = static_cast<image_t>(i + 1);
      edge.image_id2 = static_cast<image_t>(j + 1);
      edge.cam2_from_cam1.rotation = CameraAt(steps);
      edge.num_inliers = are_neighbors ? num_inliers_of_neighbors : num_inliers;
      graph.edges.push_back(edge);
    }
  }
  return graph;
}

bool IsTruth(const RotationHypothesis& hypothesis) {
  const Eigen::Quaterniond& first = hypothesis.cam_from_world.at(1);
  return std::all_of(hypothesis.cam_from_world.begin(), hypothesis.cam_from_world.end(),
                     [&](const auto& entry) {
                       const auto& [id, rotation] = entry;
                       const Eigen::Quaterniond truth = CameraAt(static_cast<int>(id) - 1) * first;
                       return RadToDeg(AngleBetween(rotation, truth)) < 1;
                     });
}

TEST(HypothesizeRotations, TriesWhatTheSurestPairsSayAgainstTheVotesOfMany) {
  const ViewGraph graph = LooksAlike(80, 300);
  SceneData scene;
  ReconstructSettings settings;
  settings.view_graph.min_num_inliers = 1000;  // no surer sets
  RunReport report;
  StageContext context{scene, settings, {.num_threads = 1}, report};
  const std::vector<RotationHypothesis> found =
      HypothesizeRotations(context, graph.image_ids, graph);
  ASSERT_GT(found.size(), 1u);
  EXPECT_FALSE(IsTruth(found.front()));
  EXPECT_TRUE(std::any_of(found.begin(), found.end(), IsTruth));
}

TEST(HypothesizeRotations, HasOneWhereAllAgree) {
  SceneData scene;
  ReconstructSettings settings;
  RunReport report;
  StageContext context{scene, settings, {.num_threads = 1}, report};
  ViewGraph graph = LooksAlike(0, 300);
  std::erase_if(graph.edges, [](const ViewEdge& edge) { return edge.num_inliers == 0; });
  const std::vector<RotationHypothesis> found =
      HypothesizeRotations(context, graph.image_ids, graph);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_TRUE(IsTruth(found[0]));
}

}  // namespace
}  // namespace cairn
