#pragma once

#include <memory>
#include <string>
#include <vector>

#include "common/program.h"

namespace cairn {

// A subcommand whose flags are one struct: run is called once they are read and those that are
// required are there.
template <class Flags>
void AddCommand(Program& program, const std::string& name, const std::string& description,
                const std::vector<std::string>& required, int (*run)(Command&, Flags&)) {
  Command& command = program.AddCommand(name, description);
  const auto flags = std::make_shared<Flags>();
  command.AddOptions("", *flags);
  command.SetRun([&command, flags, required, run] {
    for (const std::string& key : required) command.Require(key);
    return run(command, *flags);
  });
}

// A subcommand is one file with one function, declared here and called in main.cc. It adds itself
// to the program, with its options (kept alive by the run function).

void AddEvaluateCommand(Program& program);
void AddExportCommand(Program& program);
void AddGeoregisterCommand(Program& program);
void AddInspectCommand(Program& program);
void AddReconstructCommand(Program& program);
void AddRefineCommand(Program& program);
void AddReportCommand(Program& program);
void AddRotationAveragingCommand(Program& program);
void AddSynthesizeCommand(Program& program);
void AddUndistortCommand(Program& program);

}  // namespace cairn
