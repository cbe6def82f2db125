#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace cairn::internal {

// The labelling of GC-RANSAC (Barath and Matas, "Graph-cut RANSAC", CVPR 2018, eq. 2-4): right and
// wrong matches are told apart by their errors and by their neighbours, by a minimum cut. With
// K = exp(-error^2 / (2 scale^2)), a right match costs 1 - K and a wrong one K; neighbours pay
// `coherence` if their labels differ, times (K_i + K_j) / 2 if both are wrong and 1 minus that if
// both are right.
struct GraphCutProblem {
  std::vector<double> closeness;  // K of each match, in [0, 1]
  std::vector<std::pair<int32_t, int32_t>> neighbours;
  double coherence = 0.14;  // the paper's lambda
};

// The labels of least energy: true for right matches. Maximum flow by Dinic's algorithm (1970).
std::vector<bool> MinimizeByGraphCut(const GraphCutProblem& problem);

// The energy of a labelling, for tests.
double GraphCutEnergy(const GraphCutProblem& problem, const std::vector<bool>& is_right);

// Neighbours are matches in the same cell of a grid over both images, at most `max_num` each, cells
// of cell_px. Positions x1, y1, x2, y2 in pixels.
struct MatchPosition {
  double v[4];
};
std::vector<std::pair<int32_t, int32_t>> NeighboursInGrid(std::span<const MatchPosition> positions,
                                                          double cell_px, int max_num);

}  // namespace cairn::internal
