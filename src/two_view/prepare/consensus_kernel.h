#pragma once

namespace cairn::internal {

// Adds to counts[k] the votes of LocalConsensus; returns the number of pairs of matches that are
// neighbours in both images. columns: twelve columns of `stride` floats, x1 y1
// x2 y2 A (row-major) A^-1, sorted by x1; at least 16 more rows than `n`, far away from all others.
double CountConsensus(const float* columns, int n, int stride, float radius1_px, float radius2_px,
                      float* counts);

// Chance that a frame predicts a neighbour, where neighbours fill circles of this radius.
double ConsensusChance(double squared_radius_px);

}  // namespace cairn::internal
