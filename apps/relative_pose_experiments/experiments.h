#pragma once

#include <string>
#include <vector>

#include "cairn/base/progress.h"
#include "cairn/two_view/options.h"
#include "common/run_flags.h"
#include "relative_pose_experiments/real_scene.h"
#include "relative_pose_experiments/table.h"

namespace cairn::experiments {

struct ExperimentOptions : RunFlags {
  std::string output_path;
  std::string experiment = "all";
  bool quick = false;

  void VisitFields(OptionVisitor& v) {
    v.String("output_path", output_path, "folder for the tables (CSV) and the checks");
    v.Choice("experiment", experiment,
             {"all", "complexity", "timings", "stability", "noise", "pairs"},
             "one experiment, or all");
    v.Bool("quick", quick, "fewer instances: under two minutes");
    RunFlags::VisitFields(v);
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
