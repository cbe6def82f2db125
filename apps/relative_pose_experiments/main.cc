#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "common/console_monitor.h"
#include "common/program.h"
#include "relative_pose_experiments/experiments.h"

namespace {

using namespace cairn;

int Main(int argc, char** argv) {
  Program program("relative_pose_experiments",
                  "Recomputes the tables and figures of Eichhardt and Barath, ECCV 2020.");
  Command& command = program.MainCommand();
  experiments::ExperimentOptions options;
  experiments::RealExperimentOptions real;
  command.AddOptions("", options);
  command.AddOptions("", real.data);
  command.AddOptions("verification", real.verification);
  command.SetRun([&] {
    command.Require("output_path");
    if (command.IsSet("database_path")) command.Require("reference_path");
    for (const char* key : {"reference_path", "pairs_path", "scene", "depth_name"}) {
      if (command.IsSet(key)) command.Require("database_path");
    }
    ConsoleMonitor monitor;
    CreateFolders(options.output_path);
    WriteFileAtomically(options.output_path + "/effective.toml", command.EffectiveToml());
    const auto checks = experiments::RunExperiments(options, real, monitor);
    if (monitor.StopRequested()) {
      monitor.Warning("stopped before all tables were made");
      return int{kExitNoUsableResult};
    }
    int num_failed = 0;
    for (const experiments::FigureCheck& check : checks) {
      if (check.Holds()) continue;
      ++num_failed;
      monitor.Warning(check.name + " is " + experiments::FormatNumber(check.value) + ", not in [" +
                      experiments::FormatNumber(check.min) + ", " +
                      experiments::FormatNumber(check.max) + "]");
    }
    if (!checks.empty()) {
      monitor.Info(std::to_string(checks.size() - num_failed) + " of " +
                   std::to_string(checks.size()) + " figures are within their bounds");
    }
    monitor.Info("tables are in " + options.output_path);
    return int{num_failed == 0 ? kExitSuccess : kExitNoUsableResult};
  });
  return program.Run(argc, argv);
}

}  // namespace

int main(int argc, char** argv) {
  return RunMain([&] { return Main(argc, argv); });
}
