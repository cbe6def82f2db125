#pragma once

#include "cairn/base/run_context.h"
#include "cairn/database/database.h"
#include "cairn/pair_selection/pair_selection.h"

namespace cairn {

// Reads the features of all images and describes these. An image whose features cannot be read is
// left out and reported by Warning. Empty when the monitor wants to stop.
DescribedImages DescribeImages(const Database& database, const PairSelectionOptions& options,
                               const RunContext& run);

}  // namespace cairn
