#pragma once

#include <string>

#include "cairn/mapper/reconstruct.h"

namespace cairn {

// At most ten lines for the terminal: models, photos, points, error, confidence, warnings, time,
// files; of a failed run, where its report is.
std::string DescribeResult(const ReconstructResult& result, const std::string& output_path,
                           const RunContext& run);

}  // namespace cairn
