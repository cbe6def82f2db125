#include "translation_averaging/one_dsfm_filter.h"

#include "support/test.h"
#include "unit/translation_averaging/direction_test_util.h"

namespace cairn {
namespace {

DirectionScene Landmark(double outlier_ratio, uint64_t seed) {
  Rng rng(seed, "filter test");
  DirectionScene scene;
  std::vector<Eigen::Vector3d> centers;
  for (int k = 0; k < 40; ++k) centers.push_back(RandomOfLength(0, 3, rng));
  scene.AddCenters(centers);
  for (image_t a = 1; a <= 40; ++a) {
    for (image_t b = a + 1; b <= 40; ++b) {
      if (rng.Uniform() < 0.5) scene.AddEdge(a, b, 1.0, outlier_ratio, rng);
    }
  }
  return scene;
}

TEST(OneDsfmFilter, ConsistentDirectionsHaveNoInconsistency) {
  const DirectionScene scene = Landmark(0, 1);
  DirectionScene exact = scene;
  for (DirectionEdge& e : exact.edges) {
    e.direction = exact.truth[e.image_id2] - exact.truth[e.image_id1];
  }
  const DirectionProblem problem = MakeDirectionProblem(exact.edges, {});
  for (const double value : OneDsfmInconsistency(problem, 48, 0, 1)) EXPECT_LT(value, 1e-12);
}

TEST(OneDsfmFilter, SeparatesOutliers) {
  const DirectionScene scene = Landmark(0.25, 2);
  const DirectionProblem problem = MakeDirectionProblem(scene.edges, {});
  const std::vector<double> values = OneDsfmInconsistency(problem, 48, 0, 1);
  int caught = 0, lost = 0, num_wrong = 0;
  for (size_t e = 0; e < scene.edges.size(); ++e) {
    const bool is_out = values[problem.edge_of_input[e]] > 0.1;
    num_wrong += scene.edge_is_wrong[e];
    caught += is_out && scene.edge_is_wrong[e];
    lost += is_out && !scene.edge_is_wrong[e];
  }
  EXPECT_GT(caught, 0.6 * num_wrong);  // many random directions are hardly wrong on most axes
  EXPECT_LT(lost, 0.03 * static_cast<double>(scene.edges.size()));
}

// As many wrong edges as right ones, all in one direction along a line, but of fewer points.
TEST(OneDsfmFilter, EdgesVoteByTheirPoints) {
  std::vector<DirectionEdge> edges;
  for (image_t id = 1; id < 30; ++id) edges.push_back({id, id + 1, Eigen::Vector3d::UnitX()});
  const size_t num_right = edges.size();
  for (image_t id = 1; id <= 20; ++id) {
    for (const image_t far : {8, 9, 10}) {
      edges.push_back({id, id + far, -Eigen::Vector3d::UnitX()});
    }
  }
  const auto num_lost = [&] {
    const DirectionProblem problem = MakeDirectionProblem(edges, {});
    const std::vector<double> values = OneDsfmInconsistency(problem, 48, 0, 1);
    int num = 0;
    for (size_t e = 0; e < num_right; ++e) num += values[problem.edge_of_input[e]] > 0.1;
    return num;
  };
  EXPECT_GT(num_lost(), 5);
  for (size_t e = 0; e < edges.size(); ++e) edges[e].num_points = e < num_right ? 1000 : 50;
  EXPECT_EQ(num_lost(), 0);
}

TEST(OneDsfmFilter, DependsOnTheSeedAloneNotOnThreads) {
  const DirectionProblem problem = MakeDirectionProblem(Landmark(0.25, 3).edges, {});
  const std::vector<double> reference = OneDsfmInconsistency(problem, 48, 7, 1);
  EXPECT_EQ(OneDsfmInconsistency(problem, 48, 7, 8), reference);
  EXPECT_NE(OneDsfmInconsistency(problem, 48, 8, 1), reference);
}

}  // namespace
}  // namespace cairn
