#include "relative_pose_experiments/experiments.h"

#include <iterator>
#include <nlohmann/json.hpp>

#include "cairn/base/file.h"
#include "relative_pose_experiments/complexity.h"
#include "relative_pose_experiments/noise.h"
#include "relative_pose_experiments/real_pairs.h"
#include "relative_pose_experiments/stability.h"
#include "relative_pose_experiments/synthetic_scene.h"

namespace cairn::experiments {
namespace {

void Append(std::vector<FigureCheck> added, std::vector<FigureCheck>* checks) {
  std::move(added.begin(), added.end(), std::back_inserter(*checks));
}

void WriteChecks(const std::vector<FigureCheck>& checks, const std::string& path) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const FigureCheck& check : checks) {
    json.push_back({{"name", check.name},
                    {"value", check.value},
                    {"min", check.min},
                    {"max", check.max},
                    {"holds", check.Holds()}});
  }
  WriteFileAtomically(path, json.dump(1) + "\n");
}

// Figure 6 and the appendix, on the database that the options name, or else on a synthetic scene,
// of which the bounds are. Tables are named by scene and depth source, so that runs can share a
// folder.
std::vector<FigureCheck> RunPairExperiment(const ExperimentOptions& options,
                                           RealExperimentOptions real, ProgressMonitor& monitor) {
  const auto seed = static_cast<uint64_t>(options.seed);
  const bool is_synthetic = real.data.database_path.empty();
  if (is_synthetic) real.data = WriteSyntheticScene(options.output_path, options.quick, seed);
  const RealScene scene = LoadRealScene(real.data, real.verification.min_num_matches, monitor);
  const std::string prefix =
      options.output_path + "/" + real.data.scene + "." + real.data.depth_name;
  const SingleReport single = RunSingleCorrespondences(scene, options.num_threads);
  SingleSummaryTable(single, real.data).Write(prefix + ".single.csv");
  SingleDistributionTable(single, real.data).Write(prefix + ".single_distribution.csv");
  const auto results = RunRealPairs(scene, real.verification, seed, monitor);
  if (monitor.StopRequested()) return {};
  PairTable(results, real.data).Write(prefix + ".pairs.csv");
  PairSummaryTable(results, real.data).Write(prefix + ".pairs_summary.csv");
  PairTimeTable(results, real.data).Write(prefix + ".pair_timings.csv");
  if (!is_synthetic) return {};
  std::vector<FigureCheck> checks = Checks(single);
  Append(Checks(results), &checks);
  return checks;
}

}  // namespace

std::vector<FigureCheck> RunExperiments(const ExperimentOptions& options,
                                        const RealExperimentOptions& real,
                                        ProgressMonitor& monitor) {
  const auto wanted = [&](const char* name) {
    return (options.experiment == name || options.experiment == "all") && !monitor.StopRequested();
  };
  const auto path = [&](const char* name) { return options.output_path + "/" + name; };
  const auto seed = static_cast<uint64_t>(options.seed);
  CreateFolders(options.output_path);
  std::vector<FigureCheck> checks, time_checks;

  if (wanted("complexity")) {
    monitor.Info("counting operations");
    const ComplexityReport report = RunComplexity(seed, 1000, options.quick ? 2 : 50);
    ToTable(report).Write(path("complexity.csv"));
    IterationTable(report).Write(path("iterations.csv"));
    Append(Checks(report), &checks);
  }
  if (wanted("timings")) {
    monitor.Info("timing the solvers");
    const auto times = TimeSolvers(seed, 1000, options.quick ? 10 : 100);
    ToTable(times).Write(path("timings.csv"));
    time_checks = Checks(times);
  }
  const bool needs_instances = wanted("stability") || wanted("noise");
  const auto instances =
      needs_instances ? MakeInstances(seed, options.quick ? 1000 : 30000, options.num_threads)
                      : std::vector<Instance>();
  if (wanted("stability")) {
    monitor.Info("stability of the solvers");
    const auto figures = RunStability(instances, options.num_threads);
    ToTable(figures).Write(path("stability.csv"));
    HistogramTable(figures).Write(path("stability_histograms.csv"));
    Append(Checks(figures), &checks);
  }
  if (wanted("noise")) {
    const NoiseReport report = RunNoise(instances, seed, options.num_threads, monitor);
    if (!monitor.StopRequested()) {
      CurveTable(report).Write(path("noise_curves.csv"));
      HeatMapTable(report).Write(path("noise_heat_maps.csv"));
      Append(Checks(report), &checks);
    }
  }
  if (wanted("pairs")) Append(RunPairExperiment(options, real, monitor), &checks);
  const std::string checks_path = path("checks.") + options.experiment;
  if (!checks.empty()) WriteChecks(checks, checks_path + ".json");
  if (!time_checks.empty()) WriteChecks(time_checks, checks_path + ".timings.json");
  Append(std::move(time_checks), &checks);
  return checks;
}

}  // namespace cairn::experiments
