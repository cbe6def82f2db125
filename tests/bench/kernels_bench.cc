// The kernels of robust estimation by number of correspondences; the counters give the time a
// correspondence (and model), and of an iteration. CAIRN_BENCH_TARGET=AVX2 (or SSE4) in the
// environment leaves out what is newer.
#include <benchmark/benchmark.h>
#include <hwy/targets.h>

#include <cstdlib>
#include <string_view>

#include "cairn/geometry/epipolar.h"
#include "cairn/solvers/one_affine_depth_batch.h"
#include "robust/pose_refinement.h"
#include "robust/sampson_kernels.h"
#include "support/random_two_view.h"

namespace cairn {
namespace {

constexpr double kFocal = 1000.0;

struct Problem {
  TwoViewScene scene;
  PointPairs points;
  Eigen::Matrix3d E;
};

// Half of the matches are wrong.
Problem MakeProblem(int n) {
  Rng rng(1);
  Problem problem;
  problem.scene = RandomScene(rng, n);
  problem.points.Reset(n, kFocal, kFocal);
  for (int i = 0; i < n; ++i) {
    const PointCorrespondence p = problem.scene.patches[i].points();
    const PointCorrespondence q = problem.scene.patches[i % 2 == 0 ? i : n - 1 - i].points();
    problem.points.Set(i, p.x1, q.x2);
  }
  problem.E = EssentialFromPose(problem.scene.cam2_from_cam1);
  return problem;
}

void SetPerItem(benchmark::State& state, int64_t num_items) {
  state.counters["time_each"] = benchmark::Counter(
      static_cast<double>(num_items),
      benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void BM_ScoreSampson(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const Problem problem = MakeProblem(n);
  for (auto _ : state) benchmark::DoNotOptimize(ScoreSampson(problem.points, problem.E, 1.0));
  SetPerItem(state, n);
  const int64_t targets = hwy::SupportedTargets();
  state.SetLabel(hwy::TargetName(targets & -targets));  // the best one
}
BENCHMARK(BM_ScoreSampson)->Arg(192)->Arg(1024)->Arg(8192);

void BM_SoftScoreSampson(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const Problem problem = MakeProblem(n);
  for (auto _ : state) benchmark::DoNotOptimize(SoftScoreSampson(problem.points, problem.E, 7.0));
  SetPerItem(state, n);
}
BENCHMARK(BM_SoftScoreSampson)->Arg(192)->Arg(1024);

void BM_AccumulateSampson(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const Problem problem = MakeProblem(n);
  const Rigid3d& pose = problem.scene.cam2_from_cam1;
  const Eigen::Matrix<double, 3, 2> tangent = Eigen::Matrix3d::Identity().leftCols<2>();
  for (auto _ : state) {
    benchmark::DoNotOptimize(
        AccumulateSampson(problem.points, pose, tangent, RobustLoss::kGemanMcClure, 1.0));
  }
  SetPerItem(state, n);
}
BENCHMARK(BM_AccumulateSampson)->Arg(192)->Arg(1024);

// The argument is the number of correspondences.
void BM_RefinePose(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const Problem problem = MakeProblem(n);
  Rigid3d start = problem.scene.cam2_from_cam1;
  start.rotation =
      Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitX())) * start.rotation;
  PoseRefinementOptions options;
  options.loss = RobustLoss::kGemanMcClure;
  options.scale_px = 7.0;
  options.max_iterations = 8;
  for (auto _ : state) benchmark::DoNotOptimize(RefinePose(problem.points, start, options));
}
BENCHMARK(BM_RefinePose)->Arg(16)->Arg(192)->Arg(1024);

void BM_OneAffineDepthBatch(benchmark::State& state) {
  const int n = static_cast<int>(state.range(0));
  const Problem problem = MakeProblem(n);
  OneAffineDepthBatch batch;
  batch.Reset(n);
  for (int i = 0; i < n; ++i) {
    const LiftedCorrespondence& lifted = problem.scene.patches[i].lifted;
    batch.Set(i, lifted.frame1, lifted.frame2);
  }
  for (auto _ : state) {
    batch.Solve();
    benchmark::ClobberMemory();
  }
  SetPerItem(state, n);
}
BENCHMARK(BM_OneAffineDepthBatch)->Arg(256)->Arg(1024);

// Newer instruction sets have lower bits.
const bool kTargetIsChosen = [] {
  const char* name = std::getenv("CAIRN_BENCH_TARGET");
  if (name == nullptr) return false;
  const int64_t newest = std::string_view(name) == "AVX2" ? HWY_AVX2 : HWY_SSE4;
  hwy::DisableTargets(newest - 1);
  return true;
}();

}  // namespace
}  // namespace cairn
