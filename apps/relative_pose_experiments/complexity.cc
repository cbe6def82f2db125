#include "relative_pose_experiments/complexity.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <vector>

#include "cairn/base/timer.h"
#include "relative_pose_experiments/operation_counter.h"
#include "relative_pose_experiments/solver_runs.h"

namespace cairn::experiments {
namespace {

// The row "1 iter" of the paper's Table 1; 2AC+5PT is not in it.
constexpr std::array<int, kNumSolvers> kPaperOperations = {2325, 1424, 345, 133, 0};

// Means; what is counted on the processor is 0 where that is not possible.
struct SolverCost {
  double models_per_sample = 0;
  double operations = 0;
  double divisions_and_roots = 0;  // those among them
  double instructions = 0;
};

template <class SolverType>
SolverCost MeanCost(const std::vector<Instance>& instances, int num_counted) {
  const int64_t call_overhead = CountOperations([] {}).instructions;
  OperationCount sum;
  int64_t num_models = 0;
  for (size_t i = 0; i < instances.size(); ++i) {
    const auto sample = SampleOf<SolverType>(instances[i]);
    typename SolverType::Model models[SolverType::kMaxSolutions];
    num_models += SolverType::Solve(sample.data(), models);
    if (static_cast<int>(i) >= num_counted) continue;
    sum += CountOperations([&] { SolverType::Solve(sample.data(), models); });
    sum.instructions -= call_overhead;
  }
  const double n = std::max(num_counted, 1);
  return {.models_per_sample = static_cast<double>(num_models) / instances.size(),
          .operations = sum.Arithmetic() / n,
          .divisions_and_roots = (sum.divisions + sum.square_roots) / n,
          .instructions = sum.instructions / n};
}

template <class SolverType>
double LeastNanoseconds(const std::vector<Instance>& instances, int num_passes) {
  std::vector<decltype(SampleOf<SolverType>(instances[0]))> samples;
  for (const Instance& instance : instances) samples.push_back(SampleOf<SolverType>(instance));
  typename SolverType::Model models[SolverType::kMaxSolutions];
  double least = std::numeric_limits<double>::infinity();
  for (int pass = 0; pass < num_passes; ++pass) {
    const Timer timer;
    for (const auto& sample : samples) SolverType::Solve(sample.data(), models);
    least = std::min(least, 1e9 * timer.Seconds() / static_cast<double>(samples.size()));
  }
  return least;
}

}  // namespace

double RansacIterations(double outlier_share, int sample_size) {
  const double good_sample = std::pow(1.0 - outlier_share, sample_size);
  return std::log1p(-0.99) / std::log1p(-good_sample);
}

Results RunComplexity(uint64_t seed, int num_instances, int num_counted) {
  const std::vector<Instance> instances = MakeInstances(seed, num_instances, 1);
  Results results;
  std::map<Solver, SolverCost> costs;
  for (const Solver solver : kAllSolvers) {
    const int paper_operations = kPaperOperations[static_cast<int>(solver)];
    const int sample_size = SampleSize(solver);
    const SolverCost cost = costs[solver] = WithSolverType(
        solver, [&]<class SolverType>() { return MeanCost<SolverType>(instances, num_counted); });
    for (const double share : {0.50, 0.75, 0.90}) {
      const double iterations = RansacIterations(share, sample_size);
      results.tables["complexity"].AddRow(
          {{"solver", SolverName(solver)},
           {"sample_size", sample_size},
           {"paper_operations", paper_operations},
           {"counted_operations", cost.operations},
           {"counted_divisions_and_roots", cost.divisions_and_roots},
           {"counted_instructions", cost.instructions},
           {"models_per_sample", cost.models_per_sample},
           {"outlier_share", share},
           {"iterations", iterations},
           {"paper_total", iterations * paper_operations},
           {"counted_total", iterations * cost.operations}});
    }
    for (int percent = 5; percent <= 95; percent += 5) {
      const double iterations = RansacIterations(percent / 100.0, sample_size);
      results.tables["iterations"].AddRow({{"solver", SolverName(solver)},
                                           {"outlier_share", percent / 100.0},
                                           {"iterations", iterations},
                                           {"paper_operations", iterations * paper_operations},
                                           {"counted_operations", iterations * cost.operations}});
    }
  }
  const SolverCost &five_point = costs[Solver::kFivePoint], &proposed = costs[Solver::kProposed];
  results.checks = {
      {"complexity.models.proposed", proposed.models_per_sample, 0.999, 1.0},
      {"complexity.models.5PT", five_point.models_per_sample, 3, 6},
      {"complexity.iterations.5PT.0.75", RansacIterations(0.75, 5), 4712, 4714},
      {"complexity.iterations.2AC.0.90", RansacIterations(0.90, 2), 458, 459},
      {"complexity.iterations.1AC+D.0.90", RansacIterations(0.90, 1), 43, 44},
  };
  if (CanCountOperations()) {
    results.checks.push_back({"complexity.counted.proposed", proposed.operations, 100, 500});
    results.checks.push_back({"complexity.counted.5PT_over_proposed",
                              five_point.operations / proposed.operations, 10, 1000});
  }
  return results;
}

Results TimeSolvers(uint64_t seed, int64_t num_instances, int num_passes) {
  const std::vector<Instance> instances = MakeInstances(seed, num_instances, 1);
  Results results;
  std::map<Solver, double> ns;
  for (const Solver solver : kAllSolvers) {
    ns[solver] = WithSolverType(solver, [&]<class SolverType>() {
      return LeastNanoseconds<SolverType>(instances, num_passes);
    });
    results.tables["timings"].AddRow({{"solver", SolverName(solver)}, {"ns", ns[solver]}});
  }
  results.checks = {
      {"timings.5PT_over_proposed", ns[Solver::kFivePoint] / ns[Solver::kProposed], 5, 1e6}};
  return results;
}

}  // namespace cairn::experiments
