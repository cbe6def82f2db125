// Averaging on landmark graphs by size, with 20 % outliers and heavy-tailed errors; the counters
// give the errors against the truth.
#include <benchmark/benchmark.h>

#include "cairn/rotation_averaging/rotation_averaging.h"
#include "cairn/synthetic/view_graph_problem.h"
#include "unit/rotation_averaging/rotation_test_util.h"

namespace cairn {
namespace {

ViewGraphProblem LandmarkProblem(int num_images, int num_edges) {
  ViewGraphOptions options;
  options.num_images = num_images;
  options.num_edges = num_edges;
  options.heavy_tail = 1.0;
  options.outlier_ratio = 0.2;
  return MakeViewGraphProblem(options, 1);
}

void BM_RotationAveraging(benchmark::State& state) {
  const ViewGraphProblem problem =
      LandmarkProblem(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
  std::vector<RotationEdge> edges;
  testing::Rotations truth;
  for (const ViewEdge& e : problem.graph.edges) {
    edges.push_back({e.image_id1, e.image_id2, e.cam2_from_cam1.rotation,
                     static_cast<double>(std::max(1, e.num_inliers))});
  }
  for (const auto& [id, pose] : problem.cam_from_world) truth[id] = pose.rotation;
  RotationAveragingReport report;
  for (auto _ : state) report = AverageRotations(edges);
  const auto summary =
      testing::Summarize(testing::AlignedRotationErrorsDeg(report.cam_from_world, truth));
  state.counters["median_deg"] = summary.median;
  state.counters["mean_deg"] = summary.mean;
  state.counters["below_5deg"] = summary.FractionBelow(5);
  state.counters["irls"] = report.num_irls_iterations;
}
BENCHMARK(BM_RotationAveraging)
    ->Args({250, 20000})
    ->Args({500, 50000})
    ->Args({1000, 100000})
    ->Args({2000, 200000})
    ->Unit(benchmark::kMillisecond)
    ->Iterations(1);

}  // namespace
}  // namespace cairn
