#pragma once

#include <map>
#include <string>
#include <vector>

#include "cairn/base/run_context.h"
#include "cairn/database/database.h"
#include "cairn/pair_selection/pair_selection.h"

namespace cairn {

// Reads the features of all images and finds for each those that look like it, best first
// (pair_selection.h). An image whose features cannot be read has none and is reported by Warning.
// Empty when the monitor wants to stop.
std::map<image_t, std::vector<Candidate>> ReadCandidates(const Database& database,
                                                         const PairSelectionOptions& options,
                                                         const RunContext& run);

}  // namespace cairn
