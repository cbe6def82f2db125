#pragma once

#include <memory>

#include "cairn/base/peers.h"

namespace cairn {

// The job that mpirun (or Slurm's srun) started this process in; nullptr where it was started
// alone, which costs nothing: MPI is left alone then. Before the object is destroyed, all processes
// must be done; destroying it waits for the others to do the same. Throws ConfigError where cairn
// was built without MPI and this is not the job's first process. Once a process.
std::unique_ptr<Peers> JoinJob();

}  // namespace cairn
