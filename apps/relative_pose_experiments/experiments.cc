#include "relative_pose_experiments/experiments.h"

#include <nlohmann/json.hpp>

#include "cairn/base/file.h"
#include "cairn/synthetic/scene.h"
#include "relative_pose_experiments/complexity.h"
#include "relative_pose_experiments/noise.h"
#include "relative_pose_experiments/real_pairs.h"
#include "relative_pose_experiments/stability.h"

namespace cairn::experiments {
namespace {

void WriteChecks(const std::vector<FigureCheck>& checks, const std::string& path) {
  if (checks.empty()) return;
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

// What stands for the photographs where none are given: a scene of the synthetic module, as
// build_view_graph would leave it after matching, with its true model. Of the matches 60 % are
// wrong; positions, frames and depths have errors of the size that those of photographs have.
RealDataOptions WriteSyntheticScene(const std::string& folder, bool quick, uint64_t seed) {
  SceneOptions options;
  options.num_images = quick ? 8 : 24;
  options.num_points = 1500;
  options.max_keypoints = 600;
  options.image_noise_px = 0.3;
  options.affine_noise = 0.15;
  options.depth_noise = 0.1;
  options.depth_gradient_noise = 0.2;
  options.missing_depth_ratio = 0.05;
  options.outlier_ratio = 0.6;
  RealDataOptions data;
  data.scene = "synthetic";
  data.depth_name = "simulated";
  data.database_path = folder + "/scene.db";
  data.reference_path = folder + "/truth";
  WriteSceneFolder(MakeScene(options, seed), SceneContent::kMatches, folder);
  return data;
}

// Figure 6 and the appendix, on the database that the options name, or else on a synthetic scene,
// for which the bounds hold. Tables are named by scene and depth source, so that runs can share a
// folder.
Results RunPairExperiment(const ExperimentOptions& options, RealExperimentOptions real,
                          ProgressMonitor& monitor) {
  const auto seed = static_cast<uint64_t>(options.seed);
  const bool is_synthetic = real.data.database_path.empty();
  if (is_synthetic) {
    real.data = WriteSyntheticScene(options.output_path + "/synthetic", options.quick, seed);
  }
  const RealScene scene = LoadRealScene(real.data, real.verification.min_num_matches, monitor);
  const SingleReport single = RunSingleCorrespondences(scene, options.num_threads);
  const auto pairs = RunRealPairs(scene, real.verification, seed, monitor);
  Results results;
  if (monitor.StopRequested()) return results;
  for (const Results& part : {TabulateSingle(single, real.data), TabulatePairs(pairs, real.data)}) {
    for (const auto& [name, table] : part.tables) {
      results.tables[real.data.scene + "." + real.data.depth_name + "." + name] = table;
    }
    if (!is_synthetic) continue;
    results.checks.insert(results.checks.end(), part.checks.begin(), part.checks.end());
  }
  return results;
}

}  // namespace

std::vector<FigureCheck> RunExperiments(const ExperimentOptions& options,
                                        const RealExperimentOptions& real,
                                        ProgressMonitor& monitor) {
  const auto wanted = [&](const char* name) {
    return (options.experiment == name || options.experiment == "all") && !monitor.StopRequested();
  };
  const std::string folder = options.output_path + "/";
  const auto seed = static_cast<uint64_t>(options.seed);
  CreateFolders(options.output_path);
  std::vector<FigureCheck> checks;
  const auto keep = [&](const Results& results) {
    for (const auto& [name, table] : results.tables) {
      WriteFileAtomically(folder + name + ".csv", table.ToCsv());
    }
    checks.insert(checks.end(), results.checks.begin(), results.checks.end());
  };

  if (wanted("complexity")) {
    monitor.Info("counting operations");
    keep(RunComplexity(seed, 1000, options.quick ? 2 : 50));
  }
  const bool needs_instances = wanted("stability") || wanted("noise");
  const auto instances =
      needs_instances ? MakeInstances(seed, options.quick ? 1000 : 30000, options.num_threads)
                      : std::vector<Instance>();
  if (wanted("stability")) {
    monitor.Info("stability of the solvers");
    keep(RunStability(instances, options.num_threads));
  }
  if (wanted("noise")) keep(RunNoise(instances, seed, options.num_threads, monitor));
  if (wanted("pairs")) keep(RunPairExperiment(options, real, monitor));
  if (monitor.StopRequested()) return checks;
  const std::string checks_path = folder + "checks." + options.experiment;
  WriteChecks(checks, checks_path + ".json");
  if (wanted("timings")) {  // in a file of their own: they are not deterministic
    monitor.Info("timing the solvers");
    const Results times = TimeSolvers(seed, 1000, options.quick ? 10 : 100);
    WriteChecks(times.checks, checks_path + ".timings.json");
    keep(times);
  }
  return checks;
}

}  // namespace cairn::experiments
