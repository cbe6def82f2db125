#pragma once

#include "two_view/prepare/prepared_pair.h"

namespace cairn::internal {

// Repeated structure gives a pair two models that explain about as many matches, each in its own
// part of them, and support alone does not tell which is right. Looks for a second model among the
// matches that the first one does not explain, where those that bear each other out are many. Where
// they are far more than those that it explains, it is one of many, whether or not one of the
// others stands out.

// The matches of a second model that has at least options.min_competing_share of the first one's
// support, or of many others; empty if there is none. `pair` is ordered by consensus.
FeatureMatches FindCompetingModel(const PreparedPair& pair, const Eigen::Matrix3d& E,
                                  const TwoViewOptions& options);

}  // namespace cairn::internal
