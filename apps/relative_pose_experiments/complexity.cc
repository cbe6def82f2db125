#include "relative_pose_experiments/complexity.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cairn/base/timer.h"
#include "relative_pose_experiments/operation_counter.h"

namespace cairn::experiments {
namespace {

// The sums of the paper's Table 1.
int PaperOperations(Solver solver) {
  switch (solver) {
    case Solver::kFivePoint:
      return 5 * 5 * 9 + 10 * 10 * 20 + 10 * 10;
    case Solver::kTwoAffine:
      return 6 * 6 * 9 + 10 * 10 * 10 + 10 * 10;
    case Solver::kUmeyama:
      return 11 * 3 * 3 * 3 + 27 + 21;
    case Solver::kProposed:
      return 72 + 21 + 40;
    case Solver::kTwoAffineFivePoint:
      break;
  }
  return 0;
}

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
          .counted_operations = sum.Arithmetic() / n,
          .counted_divisions_and_roots = (sum.divisions + sum.square_roots) / n,
          .counted_instructions = sum.instructions / n};
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

double RansacIterations(double outlier_share, int sample_size, double confidence) {
  const double good_sample = std::pow(1.0 - outlier_share, sample_size);
  return std::log1p(-confidence) / std::log1p(-good_sample);
}

ComplexityReport RunComplexity(uint64_t seed, int num_instances, int num_counted) {
  const std::vector<Instance> instances = MakeInstances(seed, num_instances, 1);
  ComplexityReport report;
  for (const Solver solver : kAllSolvers) {
    SolverCost cost = WithSolverType(solver, [&](auto type) {
      return MeanCost<typename decltype(type)::type>(instances, num_counted);
    });
    cost.solver = solver;
    cost.sample_size = SampleSize(solver);
    cost.paper_operations = PaperOperations(solver);
    report.solvers.push_back(cost);
  }
  return report;
}

Table ToTable(const ComplexityReport& report) {
  Table table;
  for (const SolverCost& cost : report.solvers) {
    for (const double share : kTableOutlierShares) {
      const double iterations = RansacIterations(share, cost.sample_size);
      table.AddRow({{"solver", SolverName(cost.solver)},
                    {"sample_size", cost.sample_size},
                    {"paper_operations", cost.paper_operations},
                    {"counted_operations", cost.counted_operations},
                    {"counted_divisions_and_roots", cost.counted_divisions_and_roots},
                    {"counted_instructions", cost.counted_instructions},
                    {"models_per_sample", cost.models_per_sample},
                    {"outlier_share", share},
                    {"iterations", iterations},
                    {"paper_total", iterations * cost.paper_operations},
                    {"counted_total", iterations * cost.counted_operations}});
    }
  }
  return table;
}

Table IterationTable(const ComplexityReport& report) {
  Table table;
  for (const SolverCost& cost : report.solvers) {
    for (int percent = 5; percent <= 95; percent += 5) {
      const double iterations = RansacIterations(percent / 100.0, cost.sample_size);
      table.AddRow({{"solver", SolverName(cost.solver)},
                    {"outlier_share", percent / 100.0},
                    {"iterations", iterations},
                    {"paper_operations", iterations * cost.paper_operations},
                    {"counted_operations", iterations * cost.counted_operations}});
    }
  }
  return table;
}

std::vector<FigureCheck> Checks(const ComplexityReport& report) {
  const auto at = [&](Solver solver) { return report.solvers[static_cast<int>(solver)]; };
  std::vector<FigureCheck> checks = {
      {"complexity.models.proposed", at(Solver::kProposed).models_per_sample, 0.999, 1.0},
      {"complexity.models.5PT", at(Solver::kFivePoint).models_per_sample, 3, 6},
      {"complexity.iterations.5PT.0.75", RansacIterations(0.75, 5), 4712, 4714},
      {"complexity.iterations.2AC.0.90", RansacIterations(0.90, 2), 458, 459},
      {"complexity.iterations.1AC+D.0.90", RansacIterations(0.90, 1), 43, 44},
  };
  if (CanCountOperations()) {
    const double proposed = at(Solver::kProposed).counted_operations;
    const double five_point = at(Solver::kFivePoint).counted_operations;
    checks.push_back({"complexity.counted.proposed", proposed, 100, 500});
    checks.push_back({"complexity.counted.5PT_over_proposed", five_point / proposed, 10, 1000});
  }
  return checks;
}

std::vector<SolverTime> TimeSolvers(uint64_t seed, int64_t num_instances, int num_passes) {
  const std::vector<Instance> instances = MakeInstances(seed, num_instances, 1);
  std::vector<SolverTime> times;
  for (const Solver solver : kAllSolvers) {
    times.push_back({solver, WithSolverType(solver, [&](auto type) {
                       return LeastNanoseconds<typename decltype(type)::type>(instances,
                                                                              num_passes);
                     })});
  }
  return times;
}

Table ToTable(const std::vector<SolverTime>& times) {
  Table table;
  for (const SolverTime& time : times)
    table.AddRow({{"solver", SolverName(time.solver)}, {"ns", time.ns}});
  return table;
}

std::vector<FigureCheck> Checks(const std::vector<SolverTime>& times) {
  const double five_point = times[static_cast<int>(Solver::kFivePoint)].ns;
  const double proposed = times[static_cast<int>(Solver::kProposed)].ns;
  return {{"timings.5PT_over_proposed", five_point / proposed, 5, 1e6}};
}

}  // namespace cairn::experiments
