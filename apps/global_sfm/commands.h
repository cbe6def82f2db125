#pragma once

#include "common/program.h"

namespace cairn {

// A subcommand is one file with one function, declared here and called in main.cc. It adds itself
// to the program: program.AddCommand(...), its options (kept alive by the run function), SetRun.

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
