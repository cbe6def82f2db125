#pragma once

#include "two_view/search/pose_search.h"

namespace cairn::internal {

// The steps of the cascade: each feeds hypotheses to a search until it has converged or the step's
// budget is spent. Pairs must be ordered by consensus.

// One affine correspondence with depth a hypothesis, for every match with depth in both images, up
// to some hundreds. Returns the number of hypotheses.
int RunOneAcDepthStep(const PreparedPair& pair, int max_num_refined, PoseSearch* search);

// Three matches with depth a hypothesis. The triangle that they span is an affine frame as well,
// one of the scene's size, which needs neither the frames of features nor the gradients of depth,
// and goes through the solver of 1AC+D. Right matches span triangles of one shape in both images:
// of many random triples only those that do best are scored, so a sample costs nanoseconds.
void RunTriangleStep(const PreparedPair& pair, int max_num_samples, PoseSearch* search);

// Two affine correspondences without depth a sample.
void RunTwoAcStep(const PreparedPair& pair, int max_num_samples, PoseSearch* search);

// Five points a sample.
void RunFivePointStep(const PreparedPair& pair, int max_num_samples, PoseSearch* search);

}  // namespace cairn::internal
