#include "sparse/blas_threads.h"

extern "C" void openblas_set_num_threads(int num_threads);

namespace cairn {

void SetBlasNumThreads(int num_threads) { openblas_set_num_threads(num_threads); }

}  // namespace cairn
