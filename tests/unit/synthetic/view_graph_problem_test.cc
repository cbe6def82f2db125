#include "cairn/synthetic/view_graph_problem.h"

#include <algorithm>
#include <numeric>

#include "cairn/base/error.h"
#include "cairn/math/angles.h"
#include "support/test.h"

namespace cairn {
namespace {

// Rotation errors of the edges that are no outliers, degrees, sorted.
std::vector<double> RotationErrors(const ViewGraphProblem& problem) {
  std::vector<double> errors;
  for (size_t k = 0; k < problem.graph.edges.size(); ++k) {
    const ViewEdge& edge = problem.graph.edges[k];
    if (problem.is_outlier[k]) continue;
    const Rigid3d exact = problem.cam_from_world.at(edge.image_id2) *
                          Inverse(problem.cam_from_world.at(edge.image_id1));
    errors.push_back(RadToDeg(AngleBetween(exact.rotation, edge.cam2_from_cam1.rotation)));
  }
  std::sort(errors.begin(), errors.end());
  return errors;
}

double Quantile(const std::vector<double>& sorted, double q) {
  return sorted[static_cast<size_t>(q * (sorted.size() - 1))];
}

bool IsConnected(const ViewGraph& graph) {
  std::vector<image_t> root(graph.image_ids.size() + 1);
  std::iota(root.begin(), root.end(), image_t{0});
  const auto find = [&](image_t i) {
    while (root[i] != i) i = root[i] = root[root[i]];
    return i;
  };
  for (const ViewEdge& edge : graph.edges) root[find(edge.image_id1)] = find(edge.image_id2);
  for (const image_t id : graph.image_ids) {
    if (find(id) != find(1)) return false;
  }
  return true;
}

TEST(ViewGraphProblem, CamerasAreAtTheDistance) {
  ViewGraphOptions options;
  options.layout = CameraLayout::kRing;
  options.distance = 7;
  for (const auto& [id, pose] : MakeViewGraphProblem(options, 1).cam_from_world) {
    EXPECT_NEAR(pose.Center().norm(), 7, 1.5);
  }
}

TEST(ViewGraphProblem, NoiseFreeEdgesAreExact) {
  for (const auto& [layout, name] : kCameraLayouts) {
    if (layout == CameraLayout::kCity) continue;  // of scenes
    ViewGraphOptions options;
    options.layout = layout;
    options.num_images = 40;
    options.num_edges = 200;
    options.rotation_noise_deg = options.direction_noise_deg = 0;
    const ViewGraphProblem problem = MakeViewGraphProblem(options, 1);
    ASSERT_EQ(problem.graph.edges.size(), 200u);
    EXPECT_TRUE(IsConnected(problem.graph));
    for (const ViewEdge& edge : problem.graph.edges) {
      const Rigid3d exact = problem.cam_from_world.at(edge.image_id2) *
                            Inverse(problem.cam_from_world.at(edge.image_id1));
      EXPECT_LT(AngleBetween(exact.rotation, edge.cam2_from_cam1.rotation), 1e-12);
      EXPECT_LT(AngleBetween(exact.translation, edge.cam2_from_cam1.translation), 1e-12);
      EXPECT_NEAR(edge.cam2_from_cam1.translation.norm(), 1, 1e-12);
      EXPECT_GE(edge.num_inliers, 15);
    }
  }
}

TEST(ViewGraphProblem, ATreeIsConnectedToo) {
  ViewGraphOptions options;
  options.num_images = 100;
  options.num_edges = 99;
  EXPECT_TRUE(IsConnected(MakeViewGraphProblem(options, 2).graph));
}

TEST(ViewGraphProblem, MedianErrorsAndOutliersAreAsAskedFor) {
  ViewGraphOptions options;
  options.num_edges = 8000;
  options.rotation_noise_deg = 2.0;
  options.direction_noise_deg = 5.0;
  options.outlier_ratio = 0.25;
  const ViewGraphProblem problem = MakeViewGraphProblem(options, 3);
  EXPECT_EQ(std::count(problem.is_outlier.begin(), problem.is_outlier.end(), true), 2000);
  const std::vector<double> errors = RotationErrors(problem);
  EXPECT_NEAR(Quantile(errors, 0.5), 2.0, 0.1);
  EXPECT_LT(Quantile(errors, 0.95), 5.0);
  std::vector<double> directions;
  int num_wild = 0;
  for (size_t k = 0; k < problem.graph.edges.size(); ++k) {
    const ViewEdge& edge = problem.graph.edges[k];
    const Rigid3d exact = problem.cam_from_world.at(edge.image_id2) *
                          Inverse(problem.cam_from_world.at(edge.image_id1));
    const double angle = RadToDeg(AngleBetween(exact.translation, edge.cam2_from_cam1.translation));
    if (problem.is_outlier[k]) {
      num_wild += angle > 20;
    } else {
      directions.push_back(angle);
    }
  }
  std::sort(directions.begin(), directions.end());
  EXPECT_NEAR(Quantile(directions, 0.5), 5.0, 0.3);
  EXPECT_GT(num_wild, 1700);
}

// Quantiles of the real edges against the reference rotations of 1DSfM's Ellis Island:
// 5 %: 0.32, 25 %: 1.08, 50 %: 2.9, 75 %: 11.9, 90 %: 37, 95 %: 58 degrees.
TEST(ViewGraphProblem, HeavyTailIsThatOfRealEdges) {
  ViewGraphOptions options;
  options.num_images = 247;
  options.num_edges = 20000;
  options.rotation_noise_deg = 2.9;
  options.heavy_tail = 1.0;
  const std::vector<double> errors = RotationErrors(MakeViewGraphProblem(options, 4));
  const double real[][2] = {{0.05, 0.32}, {0.25, 1.08}, {0.5, 2.9}, {0.75, 11.9}, {0.9, 37}};
  for (const auto& [q, degrees] : real) {
    EXPECT_GT(Quantile(errors, q), degrees / 1.5) << q;
    EXPECT_LT(Quantile(errors, q), degrees * 1.5) << q;
  }
}

TEST(ViewGraphProblem, SameSeedSameGraph) {
  const ViewGraphProblem a = MakeViewGraphProblem({}, 5);
  const ViewGraphProblem b = MakeViewGraphProblem({}, 5);
  const ViewGraphProblem c = MakeViewGraphProblem({}, 6);
  ASSERT_EQ(a.graph.edges.size(), b.graph.edges.size());
  size_t num_equal = 0;
  for (size_t k = 0; k < a.graph.edges.size(); ++k) {
    EXPECT_EQ(a.graph.edges[k].PairId(), b.graph.edges[k].PairId());
    EXPECT_EQ(a.graph.edges[k].num_inliers, b.graph.edges[k].num_inliers);
    EXPECT_EQ(a.graph.edges[k].cam2_from_cam1.rotation.coeffs(),
              b.graph.edges[k].cam2_from_cam1.rotation.coeffs());
    num_equal += a.graph.edges[k].PairId() == c.graph.edges[k].PairId();
  }
  EXPECT_LT(num_equal, a.graph.edges.size());
}

TEST(ViewGraphProblem, WrongOptionsAreNamed) {
  ViewGraphOptions options;
  options.layout = static_cast<CameraLayout>(99);
  EXPECT_THROW(MakeViewGraphProblem(options, 1), ConfigError);
  options.layout = CameraLayout::kCity;
  EXPECT_THROW(MakeViewGraphProblem(options, 1), ConfigError);
  options = {};
  options.num_edges = options.num_images - 2;
  EXPECT_THROW(MakeViewGraphProblem(options, 1), ConfigError);
  options.num_edges = options.num_images * options.num_images;
  EXPECT_THROW(MakeViewGraphProblem(options, 1), ConfigError);
}

}  // namespace
}  // namespace cairn
