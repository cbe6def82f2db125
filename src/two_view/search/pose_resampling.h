#pragma once

#include "two_view/search/pose_search.h"
#include "two_view/search/resampling.h"

namespace cairn::internal {

// Rounds of five-point samples drawn from what the best model explains; the best of them are
// refined on the matches near it and compared at the scale of the pair's noise (resampling.h). Adds
// the number of hypotheses.
Rigid3d ResamplePose(const PreparedPair& pair, const FoundPose& start,
                     const ResamplingOptions& options, int64_t* num_hypotheses);

}  // namespace cairn::internal
