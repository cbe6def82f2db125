#include "relative_pose_experiments/experiments.h"

#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>

#include "cairn/base/file.h"
#include "relative_pose_experiments/complexity.h"
#include "relative_pose_experiments/errata.h"
#include "relative_pose_experiments/noise.h"
#include "relative_pose_experiments/real_pairs.h"
#include "relative_pose_experiments/reconstruction_table.h"
#include "relative_pose_experiments/stability.h"
#include "relative_pose_experiments/synthetic_scene.h"

namespace cairn::experiments {
namespace {

void Append(std::vector<FigureCheck> added, std::vector<FigureCheck>* checks) {
  std::move(added.begin(), added.end(), std::back_inserter(*checks));
}

std::vector<std::string> SplitAtCommas(const std::string& text) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, ',');) parts.push_back(part);
  return parts;
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

// Tables are named by scene and depth source, so that runs can share a folder.
std::string TablePrefix(const ExperimentOptions& options, const RealDataOptions& data) {
  return options.output_path + "/" + data.scene + "." + data.depth_name;
}

// Figure 6 and the appendix. The bounds are those of the synthetic scene.
std::vector<FigureCheck> RunPairExperiment(const ExperimentOptions& options,
                                           const RealExperimentOptions& real,
                                           ProgressMonitor& monitor) {
  const RealScene scene =
      LoadRealScene(real.data, real.depth, real.verification.min_num_matches, monitor);
  const std::string prefix = TablePrefix(options, real.data);
  const SingleReport single = RunSingleCorrespondences(scene, options.num_threads);
  SingleSummaryTable(single, real.data).Write(prefix + ".single.csv");
  SingleDistributionTable(single, real.data).Write(prefix + ".single_distribution.csv");
  const auto results =
      RunRealPairs(scene, real.verification, static_cast<uint64_t>(options.seed), monitor);
  if (monitor.StopRequested()) return {};
  PairTable(results, real.data).Write(prefix + ".pairs.csv");
  PairSummaryTable(results, real.data).Write(prefix + ".pairs_summary.csv");
  PairTimeTable(results, real.data).Write(prefix + ".pair_timings.csv");
  std::vector<FigureCheck> checks = Checks(single);
  Append(Checks(results), &checks);
  return checks;
}

// Table 2. The bounds are those of the synthetic scene.
std::vector<FigureCheck> RunReconstructionExperiment(const ExperimentOptions& options,
                                                     const RealExperimentOptions& real,
                                                     ProgressMonitor& monitor) {
  ReconstructionSettings settings;
  settings.verifiers = SplitAtCommas(options.verifiers);
  settings.verification = real.verification;
  settings.refine_intrinsics = options.refine_intrinsics;
  settings.work_path = options.output_path;
  settings.seed = static_cast<uint64_t>(options.seed);
  settings.num_threads = options.num_threads;
  const auto results = RunReconstructions(real.data, real.depth, settings, monitor);
  for (const ReconstructionResult& result : results) {
    if (!result.failure.empty()) monitor.Warning(result.verifier + ": " + result.failure);
  }
  const std::string prefix = TablePrefix(options, real.data);
  ReconstructionTable(results, real.data).Write(prefix + ".reconstruction.csv");
  ReconstructionTimeTable(results, real.data).Write(prefix + ".reconstruction_timings.csv");
  return Checks(results);
}

// Both, on the photographs that the options name, or else on a synthetic scene.
std::vector<FigureCheck> RunSceneExperiments(const ExperimentOptions& options,
                                             RealExperimentOptions real, bool wants_pairs,
                                             bool wants_reconstruction, ProgressMonitor& monitor) {
  const bool is_synthetic = real.data.database_path.empty();
  if (is_synthetic) {
    real.data = WriteSyntheticScene(options.output_path, options.quick,
                                    static_cast<uint64_t>(options.seed));
  }
  std::vector<FigureCheck> checks;
  if (wants_pairs) Append(RunPairExperiment(options, real, monitor), &checks);
  if (wants_reconstruction) Append(RunReconstructionExperiment(options, real, monitor), &checks);
  return is_synthetic ? checks : std::vector<FigureCheck>();
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

  if (wanted("errata")) {
    const ErrataReport report = RunErrata(seed, 2000, options.num_threads);
    ToTable(report).Write(path("errata.csv"));
    Append(Checks(report), &checks);
  }
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
  const bool wants_pairs = wanted("pairs"), wants_reconstruction = wanted("reconstruction");
  if (wants_pairs || wants_reconstruction) {
    Append(RunSceneExperiments(options, real, wants_pairs, wants_reconstruction, monitor), &checks);
  }
  const std::string checks_path = path("checks.") + options.experiment;
  if (!checks.empty()) WriteChecks(checks, checks_path + ".json");
  if (!time_checks.empty()) WriteChecks(time_checks, checks_path + ".timings.json");
  Append(std::move(time_checks), &checks);
  return checks;
}

}  // namespace cairn::experiments
