#include <cstdio>

#include "global_sfm/commands.h"
#include "mpi/launch.h"

int main(int argc, char** argv) {
  if (cairn::IsLaunched() && cairn::LaunchedRank() > 0) {
    std::fprintf(stderr, "global_sfm works in rank 0 alone; rank %d ends\n", cairn::LaunchedRank());
    return cairn::kExitSuccess;
  }
  return cairn::RunMain([&] {
    cairn::Program program("global_sfm",
                           "Global structure-from-motion on the view graph of a database.");
    cairn::AddEvaluateCommand(program);
    cairn::AddExportCommand(program);
    cairn::AddGeoregisterCommand(program);
    cairn::AddInspectCommand(program);
    cairn::AddReconstructCommand(program);
    cairn::AddRefineCommand(program);
    cairn::AddReportCommand(program);
    cairn::AddRotationAveragingCommand(program);
    cairn::AddSynthesizeCommand(program);
    cairn::AddUndistortCommand(program);
    return program.Run(argc, argv);
  });
}
