#include "relative_pose_experiments/stability.h"

#include "cairn/base/parallel.h"
#include "cairn/geometry/epipolar.h"
#include "relative_pose_experiments/statistics.h"

namespace cairn::experiments {
namespace {

struct Errors {
  PoseErrors pose;
  double sampson_px;
};

void AddTo(Table& table, const StabilityFigures& figures, const char* error,
           const std::vector<double>& values) {
  table.AddRow({{"solver", figures.solver},
                {"error", error},
                {"median", Median(values)},
                {"p99", Quantile(values, 0.99)},
                {"p99.9", Quantile(values, 0.999)},
                {"max", Quantile(values, 1.0)},
                {"share_above_1e-6", 1.0 - ShareBelow(values, 1e-6)},
                {"instances", static_cast<int64_t>(values.size()) + figures.num_without_model},
                {"without_model", figures.num_without_model}});
}

void AddHistogramTo(Table& table, const StabilityFigures& figures, const char* error,
                    const std::vector<double>& values) {
  double low = kLog10Min;
  for (const int64_t count : LogHistogram(values)) {
    table.AddRow({{"error", error},
                  {"solver", figures.solver},
                  {"log10_min", low},
                  {"log10_max", low + kLog10BinWidth},
                  {"count", count}});
    low += kLog10BinWidth;
  }
}

}  // namespace

StabilityFigures MeasureStability(std::string solver, const PoseEstimator& estimate,
                                  const std::vector<Instance>& instances, int num_threads) {
  const auto n = static_cast<int64_t>(instances.size());
  std::vector<std::optional<Errors>> errors(n);
  ParallelFor(
      num_threads, n,
      [&](int64_t i) {
        const auto pose = estimate(instances[i]);
        if (!pose) return;
        errors[i] = {ErrorsOf(*pose, instances[i].cam2_from_cam1),
                     MeanSampsonPx(EssentialFromPose(*pose), instances[i], 0)};
      },
      64);
  StabilityFigures figures{.solver = std::move(solver)};
  for (const auto& e : errors) {
    if (!e) {
      ++figures.num_without_model;
      continue;
    }
    figures.sampson_px.push_back(e->sampson_px);
    figures.rotation_deg.push_back(e->pose.rotation_deg);
    figures.translation_deg.push_back(e->pose.translation_deg);
  }
  return figures;
}

std::vector<FigureCheck> Checks(const StabilityFigures& f) {
  const std::string name = "stability." + f.solver;
  const double n = static_cast<double>(f.rotation_deg.size()) + f.num_without_model;
  const double exact = ShareBelow(f.rotation_deg, 1e-4) * f.rotation_deg.size() / n;
  return {{name + ".rotation_median_deg", Median(f.rotation_deg), 0, 1e-9},
          {name + ".translation_median_deg", Median(f.translation_deg), 0, 1e-9},
          {name + ".sampson_median_px", Median(f.sampson_px), 0, 1e-8},
          {name + ".share_rotation_below_1e-4_deg", exact, 0.99, 1}};
}

Results RunStability(const std::vector<Instance>& instances, int num_threads) {
  Results results;
  for (const Solver solver : kAllSolvers) {
    const StabilityFigures figures = MeasureStability(
        std::string(SolverName(solver)),
        [solver](const Instance& instance) { return EstimatePose(solver, instance); }, instances,
        num_threads);
    for (const auto& [error, values] : {std::pair("sampson_px", &figures.sampson_px),
                                        std::pair("rotation_deg", &figures.rotation_deg),
                                        std::pair("translation_deg", &figures.translation_deg)}) {
      AddTo(results.tables["stability"], figures, error, *values);
      AddHistogramTo(results.tables["stability_histograms"], figures, error, *values);
    }
    std::ranges::move(Checks(figures), std::back_inserter(results.checks));
  }
  return results;
}

}  // namespace cairn::experiments
