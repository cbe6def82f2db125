#include "cairn/base/error.h"
#include "cairn/mpi/join_job.h"
#include "mpi/launch.h"

namespace cairn {
namespace {

int LaunchedRank() {
  for (const char* name : {"OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK"}) {
    if (const char* const rank = std::getenv(name)) return std::atoi(rank);
  }
  return 0;
}

}  // namespace

std::unique_ptr<Peers> JoinJob() {
  if (IsLaunched() && LaunchedRank() > 0) {
    throw ConfigError("mpirun",
                      "this program was built without MPI: install libopenmpi-dev (scripts/"
                      "install_deps does) and build again, or run one process alone");
  }
  return nullptr;
}

}  // namespace cairn
