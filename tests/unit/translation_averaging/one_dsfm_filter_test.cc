#include "translation_averaging/one_dsfm_filter.h"

#include <gmock/gmock.h>

#include "unit/translation_averaging/direction_test_util.h"

namespace cairn {
namespace {

testing::DirectionScene Landmark(double outlier_ratio, uint64_t seed) {
  Rng rng(seed, "filter test");
  testing::DirectionScene scene;
  std::vector<Eigen::Vector3d> centers;
  for (int k = 0; k < 40; ++k) centers.push_back(3 * rng.Uniform() * RandomDirection(rng));
  scene.AddCenters(centers);
  for (image_t a = 1; a <= 40; ++a) {
    for (image_t b = a + 1; b <= 40; ++b) {
      if (rng.Uniform() < 0.5) scene.AddEdge(a, b, 1.0, outlier_ratio, rng);
    }
  }
  return scene;
}

TEST(OneDsfmFilter, ConsistentDirectionsHaveNoInconsistency) {
  const testing::DirectionScene scene = Landmark(0, 1);
  testing::DirectionScene exact = scene;
  for (DirectionEdge& e : exact.edges) {
    e.direction = exact.truth[e.image_id2] - exact.truth[e.image_id1];
  }
  const DirectionProblem problem = MakeDirectionProblem(exact.edges, {});
  for (const double value : OneDsfmInconsistency(problem, 48, 0, 1)) EXPECT_LT(value, 1e-12);
}

TEST(OneDsfmFilter, SeparatesOutliers) {
  const testing::DirectionScene scene = Landmark(0.25, 2);
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

TEST(OneDsfmFilter, DependsOnTheSeedAloneNotOnThreads) {
  const DirectionProblem problem = MakeDirectionProblem(Landmark(0.25, 3).edges, {});
  const std::vector<double> reference = OneDsfmInconsistency(problem, 48, 7, 1);
  EXPECT_EQ(OneDsfmInconsistency(problem, 48, 7, 8), reference);
  EXPECT_NE(OneDsfmInconsistency(problem, 48, 8, 1), reference);
}

}  // namespace
}  // namespace cairn
