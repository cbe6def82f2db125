#include "relative_pose_experiments/stability.h"

#include <string>

#include "cairn/base/parallel.h"
#include "relative_pose_experiments/statistics.h"

namespace cairn::experiments {
namespace {

struct NamedErrors {
  const char* name;
  const std::vector<double>* values;
};

std::vector<NamedErrors> AllErrors(const StabilityFigures& figures) {
  return {{"sampson_px", &figures.sampson_px},
          {"rotation_deg", &figures.rotation_deg},
          {"translation_deg", &figures.translation_deg}};
}

}  // namespace

StabilityFigures MeasureStability(std::string solver, const PoseEstimator& estimate,
                                  const std::vector<Instance>& instances, int num_threads) {
  const auto n = static_cast<int64_t>(instances.size());
  std::vector<std::optional<PoseErrors>> errors(n);
  ParallelFor(
      num_threads, n,
      [&](int64_t i) {
        if (const auto pose = estimate(instances[i])) errors[i] = ErrorsOf(*pose, instances[i]);
      },
      64);
  StabilityFigures figures{.solver = std::move(solver)};
  for (const auto& e : errors) {
    if (!e) {
      ++figures.num_without_model;
      continue;
    }
    figures.sampson_px.push_back(e->sampson_px);
    figures.rotation_deg.push_back(e->rotation_deg);
    figures.translation_deg.push_back(e->translation_deg);
  }
  return figures;
}

std::vector<StabilityFigures> RunStability(const std::vector<Instance>& instances,
                                           int num_threads) {
  std::vector<StabilityFigures> figures;
  for (const Solver solver : kAllSolvers) {
    figures.push_back(MeasureStability(
        std::string(SolverName(solver)),
        [solver](const Instance& instance) { return EstimatePose(solver, instance); }, instances,
        num_threads));
  }
  return figures;
}

Table ToTable(const std::vector<StabilityFigures>& figures) {
  Table table;
  for (const StabilityFigures& f : figures) {
    for (const auto& [name, values] : AllErrors(f)) {
      table.AddRow({{"solver", f.solver},
                    {"error", name},
                    {"median", Median(*values)},
                    {"p99", Quantile(*values, 0.99)},
                    {"p99.9", Quantile(*values, 0.999)},
                    {"max", Quantile(*values, 1.0)},
                    {"share_above_1e-6", 1.0 - ShareBelow(*values, 1e-6)},
                    {"instances", static_cast<int64_t>(values->size()) + f.num_without_model},
                    {"without_model", f.num_without_model}});
    }
  }
  return table;
}

Table HistogramTable(const std::vector<StabilityFigures>& figures) {
  Table table;
  for (const StabilityFigures& f : figures) {
    for (const auto& [name, values] : AllErrors(f)) {
      const LogHistogram histogram = MakeLogHistogram(*values);
      for (size_t bin = 0; bin < histogram.counts.size(); ++bin) {
        const double low = histogram.log10_min + histogram.bin_width * static_cast<double>(bin);
        table.AddRow({{"error", name},
                      {"solver", f.solver},
                      {"log10_min", low},
                      {"log10_max", low + histogram.bin_width},
                      {"count", histogram.counts[bin]}});
      }
    }
  }
  return table;
}

std::vector<FigureCheck> Checks(const std::vector<StabilityFigures>& figures) {
  std::vector<FigureCheck> checks;
  for (const StabilityFigures& f : figures) {
    const std::string name = "stability." + f.solver;
    const double n = static_cast<double>(f.rotation_deg.size()) + f.num_without_model;
    checks.push_back({name + ".rotation_median_deg", Median(f.rotation_deg), 0, 1e-9});
    checks.push_back({name + ".translation_median_deg", Median(f.translation_deg), 0, 1e-9});
    checks.push_back({name + ".sampson_median_px", Median(f.sampson_px), 0, 1e-8});
    const double exact = ShareBelow(f.rotation_deg, 1e-4) * f.rotation_deg.size() / n;
    checks.push_back({name + ".share_rotation_below_1e-4_deg", exact, 0.99, 1});
  }
  return checks;
}

}  // namespace cairn::experiments
