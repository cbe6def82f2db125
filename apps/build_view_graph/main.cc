#include <spdlog/spdlog.h>

#include <iostream>
#include <map>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/database/database.h"
#include "cairn/mpi/join_job.h"
#include "cairn/pipeline/build_pipeline.h"
#include "common/console_monitor.h"
#include "common/program.h"
#include "common/run_flags.h"

namespace {

using namespace cairn;

// Options that were given for stages of which nothing was computed, in this run or an earlier one.
void WarnOfUnused(const Command& command, BuildPipelineOptions options) {
  const std::map<std::string, std::string> stage_of = {{"", "cameras"},
                                                       {"features", "features"},
                                                       {"pair_selection", "pairs"},
                                                       {"matching", "matching"},
                                                       {"verification", "verification"}};
  const Database database(options.inputs.database_path, Database::Mode::kReadOnly);
  std::string unused;
  options.VisitModules([&](const std::string& module, auto& fields) {
    const auto stage = stage_of.find(module);
    if (stage == stage_of.end() || !database.ReadJobs(stage->second).empty()) return;
    for (const OptionField& field : FieldsOf(fields)) {
      const std::string key = OptionKey(module, field.name);
      if (command.IsSet(key)) unused += (unused.empty() ? "--" : ", --") + key;
    }
  });
  if (unused.empty()) return;
  spdlog::warn("nothing was computed with {}: what they are for came from elsewhere", unused);
}

int Build(const BuildPipelineOptions& options, const RunFlags& flags,
          const std::string& effective_toml, Peers* peers) {
  ConsoleMonitor monitor;
  const BuildPipelineReport report = RunBuildPipeline(options, flags.Run(monitor), peers);
  const std::string& database_path = options.inputs.database_path;
  WriteFileAtomically(database_path + ".effective.toml", effective_toml);
  WriteFileAtomically(database_path + ".report.json", ToJson(report.run));
  std::cout << SummaryText(report.summary, report.run) << std::flush;
  if (report.run.Succeeded()) return kExitSuccess;
  spdlog::error("{}", report.run.failure);
  return kExitNoUsableResult;
}

int Main(int argc, char** argv) {
  const std::unique_ptr<Peers> peers = JoinJob();
  if (peers && peers->rank() > 0) {
    HelpToBuild(*peers);
    return kExitSuccess;
  }
  Program program(
      "build_view_graph",
      "Photographs to features, depth, matches and verified pairs, in one database that "
      "COLMAP reads.");
  Command& command = program.MainCommand();
  BuildPipelineOptions options;
  RunFlags flags;
  command.AddOptions("", options.inputs);
  command.AddOptions("", flags);
  options.VisitModules(
      [&](const char* module, auto& fields) { command.AddOptions(module, fields); });
  command.SetRun([&] {
    command.Require("database_path");
    for (const std::string& text : StoredOptions(options.inputs)) {
      command.SetDefaults(text, options.inputs.database_path);
    }
    // What was asked for once is not asked for again by --config.
    const std::string effective_toml = command.EffectiveToml({"recompute", "drop_missing"});
    const int exit_code = Build(options, flags, effective_toml, peers.get());
    if (options.inputs.stop_after == BuildStage::kVerification) WarnOfUnused(command, options);
    return exit_code;
  });
  return program.Run(argc, argv);
}

}  // namespace

int main(int argc, char** argv) {
  return RunMain([&] { return Main(argc, argv); });
}
