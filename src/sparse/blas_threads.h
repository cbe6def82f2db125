#pragma once

namespace cairn {

// Threads that OpenBLAS uses in this process from now on. Programs call SetBlasNumThreads(1) at
// their start: results must not depend on the number of cores, and parallelism lies elsewhere.
// Solvers of this module set it themselves.
void SetBlasNumThreads(int num_threads);

}  // namespace cairn
