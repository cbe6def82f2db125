#pragma once

#include <cstdint>
#include <vector>

#include "cairn/base/progress.h"
#include "relative_pose_experiments/paper_setup.h"
#include "relative_pose_experiments/table.h"

namespace cairn::experiments {

// The paper's Figures 4 and 5. Curves: one kind of noise varies (image, affine, depth) while the
// other two are fixed at zero ("alone"), or at what real data has ("together"). Heat maps: errors
// over image noise and one other kind, the third at zero. An instance without a model counts as
// 180 degrees. Nothing after a stop was asked for.
Results RunNoise(const std::vector<Instance>& instances, uint64_t seed, int num_threads,
                 ProgressMonitor& monitor);

}  // namespace cairn::experiments
