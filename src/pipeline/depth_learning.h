#pragma once

#include <utility>
#include <vector>

#include "cairn/base/progress.h"
#include "cairn/base/types.h"
#include "cairn/database/database.h"

namespace cairn {

// Learns how the depth of images is best read from those of the given pairs that are verified with
// a pose, for the images about which nothing is known yet, and stores it (cairn_image_depth). What
// it finds depends on the database alone. num_matches is Database::ReadNumMatches(). At most about
// max_bytes of features are in memory. A row that cannot be read says nothing. Where the monitor
// wants to stop, nothing is stored.
void LearnDepth(Database& database, const std::vector<image_pair_t>& pairs,
                const std::vector<std::pair<image_pair_t, int>>& num_matches, int64_t max_bytes,
                int num_threads, ProgressMonitor& monitor);

}  // namespace cairn
