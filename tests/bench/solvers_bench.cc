// The table of minimal solvers: time of one call, solutions a call, share of solutions that are
// valid (fulfil the constraints of their model and the sample's equations) and of calls that find
// the truth, on noise-free random instances.
#include <benchmark/benchmark.h>

#include <vector>

#include "cairn/geometry/epipolar.h"
#include "cairn/solvers/eight_point.h"
#include "cairn/solvers/five_point.h"
#include "cairn/solvers/homography.h"
#include "cairn/solvers/one_affine_depth.h"
#include "cairn/solvers/seven_point.h"
#include "cairn/solvers/two_affine.h"
#include "support/random_two_view.h"

namespace cairn {
namespace {

constexpr int kNumInstances = 10000;

struct Instance {
  Rigid3d cam2_from_cam1;
  double depth_scale;
  std::vector<Patch> patches;
};

const std::vector<Instance>& Instances() {
  static const std::vector<Instance> instances = [] {
    std::vector<Instance> all;
    Rng rng(1);
    for (int i = 0; i < kNumInstances; ++i) {
      const TwoViewScene scene = RandomScene(rng, 8);
      all.push_back({scene.cam2_from_cam1, scene.depth_scale, scene.patches});
    }
    return all;
  }();
  return instances;
}

template <class Sample>
Sample Convert(const Patch& patch);
template <>
PointCorrespondence Convert(const Patch& patch) {
  return patch.points();
}
template <>
AffineCorrespondence Convert(const Patch& patch) {
  return patch.affine;
}
template <>
LiftedCorrespondence Convert(const Patch& patch) {
  return patch.lifted;
}

Eigen::Matrix3d MatrixOf(const Eigen::Matrix3d& model) { return model; }
Eigen::Matrix3d MatrixOf(const ScaledPose& model) {
  return EssentialFromPose(model.cam2_from_cam1);
}

bool IsValid(const Eigen::Matrix3d& M, const Instance& instance, int sample_size) {
  double worst = 0.0;
  for (int i = 0; i < sample_size; ++i) {
    const PointCorrespondence p = instance.patches[i].points();
    worst = std::max(worst, SquaredSampsonError(M, p.x1, p.x2));
  }
  return worst < 1e-12 && std::abs(M.normalized().determinant()) < 1e-6;
}

template <class Solver>
void BM_Solver(benchmark::State& state) {
  using Sample = typename Solver::Sample;
  std::vector<Sample> samples;
  for (const Instance& instance : Instances()) {
    for (int i = 0; i < Solver::kSampleSize; ++i) {
      samples.push_back(Convert<Sample>(instance.patches[i]));
    }
  }
  typename Solver::Model models[Solver::kMaxSolutions];
  int index = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(Solver::Solve(&samples[index * Solver::kSampleSize], models));
    benchmark::DoNotOptimize(models);
    index = (index + 1) % kNumInstances;
  }
  int num_solutions = 0, num_valid = 0, num_found = 0;
  double worst_error = 0.0;  // of the truths that were found
  for (int k = 0; k < kNumInstances; ++k) {
    const Instance& instance = Instances()[k];
    const int count = Solver::Solve(&samples[k * Solver::kSampleSize], models);
    const Eigen::Matrix3d truth = EssentialFromPose(instance.cam2_from_cam1);
    double error = 1.0;
    for (int i = 0; i < count; ++i) {
      const Eigen::Matrix3d M = MatrixOf(models[i]);
      num_valid += IsValid(M, instance, Solver::kSampleSize);
      error = std::min(error, HomogeneousError(M, truth));
    }
    num_solutions += count;
    if (!(error < 1e-6)) continue;
    ++num_found;
    worst_error = std::max(worst_error, error);
  }
  state.counters["inputs"] = Solver::kSampleSize;
  state.counters["solutions"] = static_cast<double>(num_solutions) / kNumInstances;
  state.counters["valid_%"] = 100.0 * num_valid / std::max(1, num_solutions);
  state.counters["worst_error"] = worst_error;
  state.counters["found_%"] = 100.0 * num_found / kNumInstances;
}
BENCHMARK(BM_Solver<OneAffineDepthProposed>);
BENCHMARK(BM_Solver<OneAffineDepthUmeyama>);
BENCHMARK(BM_Solver<TwoAffine>);
BENCHMARK(BM_Solver<TwoAffineFivePoint>);
BENCHMARK(BM_Solver<FivePoint>);
BENCHMARK(BM_Solver<SevenPoint>);

void BM_EightPoint(benchmark::State& state) {
  std::vector<PointCorrespondence> points;
  for (const auto& patch : Instances()[0].patches) points.push_back(patch.points());
  Eigen::Matrix3d F;
  for (auto _ : state) {
    benchmark::DoNotOptimize(FundamentalFromEightPoints(points, &F));
    benchmark::DoNotOptimize(F);
  }
}
BENCHMARK(BM_EightPoint);

}  // namespace
}  // namespace cairn
