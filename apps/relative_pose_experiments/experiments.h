#pragma once

#include <string>
#include <vector>

#include "cairn/base/options.h"
#include "cairn/base/progress.h"
#include "cairn/two_view/options.h"
#include "relative_pose_experiments/real_scene.h"
#include "relative_pose_experiments/table.h"

namespace cairn::experiments {

struct ExperimentOptions {
  std::string output_path;
  std::string experiment = "all";
  bool quick = false;
  int seed = 0;
  int num_threads = -1;

  void VisitFields(OptionVisitor& v) {
    v.String("output_path", output_path, "folder for the tables (CSV) and the checks");
    v.Choice("experiment", experiment,
             {"all", "complexity", "timings", "stability", "noise", "pairs"},
             "one experiment, or all");
    v.Bool("quick", quick, "fewer instances: under two minutes");
    v.Int("seed", seed, {0, 1e9}, "seed of all random numbers");
    v.Int("num_threads", num_threads, {-1, 1024}, "threads; -1: all");
  }
};

// What the experiment pairs works on; without data.database_path, a synthetic scene.
struct RealExperimentOptions {
  RealDataOptions data;
  TwoViewOptions verification;
};

// Runs the experiments that the options name and writes their tables and checks.<experiment>.json.
// Everything but *timings.csv and *.timings.json depends on the seed alone, not on the number of
// threads. Throws IoError.
std::vector<FigureCheck> RunExperiments(const ExperimentOptions& options,
                                        const RealExperimentOptions& real,
                                        ProgressMonitor& monitor);

}  // namespace cairn::experiments
