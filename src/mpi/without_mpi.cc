#include "cairn/base/error.h"
#include "cairn/mpi/join_job.h"
#include "mpi/launch.h"

namespace cairn {

std::unique_ptr<Peers> JoinJob() {
  if (IsLaunched() && LaunchedRank() > 0) {
    throw ConfigError("mpirun",
                      "this program was built without MPI: install libopenmpi-dev (scripts/"
                      "install_deps does) and build again, or run one process alone");
  }
  return nullptr;
}

}  // namespace cairn
