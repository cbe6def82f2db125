// Averaging on landmark graphs by size, with 20 % outliers and heavy-tailed errors; the counters
// give the errors against the truth.
#include <benchmark/benchmark.h>

#include "cairn/rotation_averaging/rotation_averaging.h"
#include "cairn/synthetic/poses.h"
#include "cairn/synthetic/view_graph_problem.h"
#include "cairn/translation_averaging/translation_averaging.h"
#include "unit/rotation_averaging/rotation_test_util.h"
#include "unit/translation_averaging/direction_test_util.h"

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
  Rotations truth;
  for (const ViewEdge& e : problem.graph.edges) {
    edges.push_back({e.image_id1, e.image_id2, e.cam2_from_cam1.rotation,
                     static_cast<double>(std::max(1, e.num_inliers))});
  }
  for (const auto& [id, pose] : problem.cam_from_world) truth[id] = pose.rotation;
  RotationAveragingReport report;
  for (auto _ : state) report = AverageRotations(edges);
  const auto summary = Summarize(AlignedRotationErrorsDeg(report.cam_from_world, truth));
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

// Points on the landmark (radius 1), each seen by six cameras that have edges to the first of them,
// with 0.1 degrees of noise and 10 % wrong rays; 100 rays a camera.
std::vector<PointDirections> LandmarkTracks(const ViewGraphProblem& problem) {
  Rng rng(3, "bench tracks");
  std::map<image_t, std::vector<image_t>> neighbors;
  for (const ViewEdge& edge : problem.graph.edges) {
    neighbors[edge.image_id1].push_back(edge.image_id2);
    neighbors[edge.image_id2].push_back(edge.image_id1);
  }
  std::vector<PointDirections> tracks;
  for (const auto& [id, others] : neighbors) {
    for (int k = 0; k < 17; ++k) {
      const Eigen::Vector3d X = RandomOfLength(0, 1, rng);
      std::vector<image_t> seen_by = others;
      rng.Shuffle(seen_by);
      seen_by.resize(std::min<size_t>(5, seen_by.size()));
      seen_by.push_back(id);
      PointDirections track;
      for (const image_t camera : seen_by) {
        const Eigen::Vector3d c = problem.cam_from_world.at(camera).Center();
        const Eigen::Vector3d d = DirectionScene::Disturbed((X - c).normalized(), 0.1, rng);
        track.rays.push_back({camera, rng.Uniform() < 0.1 ? RandomDirection(rng) : d});
      }
      tracks.push_back(track);
    }
  }
  return tracks;
}

void BM_TranslationAveraging(benchmark::State& state) {
  const ViewGraphProblem problem =
      LandmarkProblem(static_cast<int>(state.range(0)), static_cast<int>(state.range(1)));
  std::vector<DirectionEdge> edges;
  for (const ViewEdge& e : problem.graph.edges) {
    const Eigen::Quaterniond& q = problem.cam_from_world.at(e.image_id2).rotation;
    edges.push_back({e.image_id1, e.image_id2, q.conjugate() * -e.cam2_from_cam1.translation});
  }
  std::vector<PointDirections> tracks;
  if (state.range(2)) tracks = LandmarkTracks(problem);
  TranslationAveragingReport report;
  for (auto _ : state) report = AverageTranslations(edges, tracks);
  Centers truth;
  for (const auto& [id, pose] : problem.cam_from_world) truth[id] = pose.Center();
  state.counters["cameras"] = static_cast<double>(report.centers.size());
  state.counters["iterations"] = report.num_iterations;
  state.counters["filtered"] = report.num_filtered;
  if (report.centers.size() < 3) return;
  std::vector<double> errors = RelativeCenterErrors(report.centers, truth);
  std::sort(errors.begin(), errors.end());
  state.counters["median_error"] = errors[errors.size() / 2];
  state.counters["error_99"] = errors[errors.size() * 99 / 100];
  state.counters["max_error"] = errors.back();
}
BENCHMARK(BM_TranslationAveraging)
    ->Args({250, 20000, 0})
    ->Args({250, 20000, 1})
    ->Args({500, 50000, 1})
    ->Args({1000, 100000, 1})
    ->Args({2000, 200000, 1})
    ->Unit(benchmark::kMillisecond)
    ->Iterations(1);

}  // namespace
}  // namespace cairn
