#pragma once

#include "cairn/base/rng.h"
#include "cairn/solvers/one_affine_depth_batch.h"
#include "two_view/search/pose_search.h"

namespace cairn::internal {

// The steps of the cascade: each feeds hypotheses to a search until it has converged or the step's
// budget is spent. Pairs must be ordered by consensus.

// One affine correspondence with depth a hypothesis, for every match with depth in both images (at
// most the first kMaxHypotheses). Returns the number of hypotheses.
class OneAcDepthStep {
 public:
  static constexpr int kMaxHypotheses = 256;
  int Run(const PairInput& input, const PreparedPair& pair, int max_num_refined,
          PoseSearch* search);

 private:
  OneAffineDepthBatch batch_;
};

// Two affine correspondences without depth a sample.
void RunTwoAcStep(const PairInput& input, const PreparedPair& pair, int max_num_samples,
                  PoseSearch* search);

// Five points a sample.
void RunFivePointStep(const PairInput& input, const PreparedPair& pair, int max_num_samples,
                      PoseSearch* search);

}  // namespace cairn::internal
