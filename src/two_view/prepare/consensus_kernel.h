#pragma once

namespace cairn::internal {

// kNum columns of `stride` floats: x1 y1 x2 y2 A (row-major) A^-1, sorted by x1. Room for a whole
// vector that starts at any match: kPadding more rows than `size`, far away from all others.
struct ConsensusColumns {
  static constexpr int kNum = 12, kPadding = 16;
  const float* data = nullptr;
  int size = 0;
  int stride = 0;
};

// Adds to counts[k] the votes of match k (local_consensus.h); returns the number of pairs of
// matches that are neighbours in both images: nearer than these radii. counts: as long as a column.
double CountConsensus(const ConsensusColumns& columns, float radius1_px, float radius2_px,
                      float* counts);

// Chance that a frame predicts a neighbour, where neighbours fill circles of this radius.
double ConsensusChance(double squared_radius_px);

}  // namespace cairn::internal
