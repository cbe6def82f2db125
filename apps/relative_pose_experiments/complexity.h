#pragma once

#include <cstdint>

#include "relative_pose_experiments/table.h"

namespace cairn::experiments {

// Samples that a random sample consensus draws until one is free of outliers with a confidence of
// 0.99: log(1 - 0.99) / log(1 - (1 - outlier_share)^sample_size). Not rounded.
double RansacIterations(double outlier_share, int sample_size);

// The paper's Table 1, counted on the processor, and its Figure 2: iterations and operations
// against the outlier share. Operations are counted on the first num_counted instances: slowly,
// instruction by instruction.
Results RunComplexity(uint64_t seed, int num_instances, int num_counted);

// Nanoseconds a call, the least of several passes over the instances (one thread).
Results TimeSolvers(uint64_t seed, int64_t num_instances, int num_passes);

}  // namespace cairn::experiments
