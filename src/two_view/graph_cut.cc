#include "two_view/graph_cut.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace cairn::internal {
namespace {

// Residual capacities as pairs of opposite arcs, 2k and 2k + 1.
class FlowNetwork {
 public:
  explicit FlowNetwork(int num_nodes) : first_(num_nodes, -1) {}

  void AddArc(int from, int to, double capacity) {
    Link(from, to, capacity);
    Link(to, from, 0.0);
  }

  // Nodes that the source still reaches once no more flow fits through.
  std::vector<bool> SourceSideOfMinimumCut(int source, int sink) {
    while (FindLevels(source, sink)) {
      next_ = first_;
      while (Push(source, sink, std::numeric_limits<double>::infinity()) > 0.0) {
      }
    }
    std::vector<bool> is_reached(first_.size());
    for (size_t i = 0; i < first_.size(); ++i) is_reached[i] = level_[i] >= 0;
    return is_reached;
  }

 private:
  static constexpr double kEmpty = 1e-12;
  struct Arc {
    int to, next;
    double capacity;
  };

  void Link(int from, int to, double capacity) {
    arcs_.push_back({to, first_[from], capacity});
    first_[from] = static_cast<int>(arcs_.size()) - 1;
  }

  bool FindLevels(int source, int sink) {
    level_.assign(first_.size(), -1);
    level_[source] = 0;
    queue_.assign(1, source);
    for (size_t k = 0; k < queue_.size(); ++k) {
      for (int a = first_[queue_[k]]; a >= 0; a = arcs_[a].next) {
        if (arcs_[a].capacity <= kEmpty || level_[arcs_[a].to] >= 0) continue;
        level_[arcs_[a].to] = level_[queue_[k]] + 1;
        queue_.push_back(arcs_[a].to);
      }
    }
    return level_[sink] >= 0;
  }

  double Push(int node, int sink, double flow) {
    if (node == sink) return flow;
    for (int& a = next_[node]; a >= 0; a = arcs_[a].next) {
      const int to = arcs_[a].to;
      if (arcs_[a].capacity <= kEmpty || level_[to] != level_[node] + 1) continue;
      const double pushed = Push(to, sink, std::min(flow, arcs_[a].capacity));
      if (pushed <= 0.0) continue;
      arcs_[a].capacity -= pushed;
      arcs_[a ^ 1].capacity += pushed;
      return pushed;
    }
    return 0.0;
  }

  std::vector<Arc> arcs_;
  std::vector<int> first_, next_, level_, queue_;
};

}  // namespace

std::vector<bool> MinimizeByGraphCut(const GraphCutProblem& problem) {
  const int n = static_cast<int>(problem.closeness.size());
  const int source = n, sink = n + 1;  // wrong matches end on the side of the source
  FlowNetwork network(n + 2);
  std::vector<double> cost_right(n), cost_wrong(n);
  for (int i = 0; i < n; ++i) {
    cost_right[i] = 1.0 - problem.closeness[i];
    cost_wrong[i] = problem.closeness[i];
  }
  // E(x_i, x_j) = A + (C - A) x_i + (D - C) x_j + (B + C - A - D) (1 - x_i) x_j (Kolmogorov and
  // Zabih, 2004), with A both wrong, D both right, B = C different.
  for (const auto& [i, j] : problem.neighbours) {
    const double mean = 0.5 * (problem.closeness[i] + problem.closeness[j]);
    cost_right[i] += problem.coherence * (1.0 - mean);
    cost_right[j] -= problem.coherence * mean;
    network.AddArc(i, j, problem.coherence);
  }
  for (int i = 0; i < n; ++i) {
    const double least = std::min(cost_right[i], cost_wrong[i]);
    network.AddArc(source, i, cost_right[i] - least);
    network.AddArc(i, sink, cost_wrong[i] - least);
  }
  std::vector<bool> labels = network.SourceSideOfMinimumCut(source, sink);
  labels.resize(n);
  labels.flip();
  return labels;
}

double GraphCutEnergy(const GraphCutProblem& problem, const std::vector<bool>& is_right) {
  double energy = 0.0;
  for (size_t i = 0; i < is_right.size(); ++i) {
    energy += is_right[i] ? 1.0 - problem.closeness[i] : problem.closeness[i];
  }
  for (const auto& [i, j] : problem.neighbours) {
    const double mean = 0.5 * (problem.closeness[i] + problem.closeness[j]);
    energy += problem.coherence * (is_right[i] != is_right[j] ? 1.0
                                   : is_right[i]              ? 1.0 - mean
                                                              : mean);
  }
  return energy;
}

std::vector<std::pair<int32_t, int32_t>> NeighboursInGrid(std::span<const MatchPosition> positions,
                                                          double cell_px, int max_num) {
  std::vector<std::array<int64_t, 4>> cells(positions.size());
  for (size_t i = 0; i < positions.size(); ++i) {
    for (int k = 0; k < 4; ++k) {
      cells[i][k] = static_cast<int64_t>(std::floor(positions[i].v[k] / cell_px));
    }
  }
  std::vector<int32_t> order(positions.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&cells](int32_t a, int32_t b) { return cells[a] < cells[b]; });
  std::vector<std::pair<int32_t, int32_t>> neighbours;
  for (size_t i = 0; i < order.size(); ++i) {
    for (size_t j = i + 1; j < std::min(order.size(), i + 1 + max_num); ++j) {
      if (cells[order[i]] != cells[order[j]]) break;
      neighbours.emplace_back(order[i], order[j]);
    }
  }
  return neighbours;
}

}  // namespace cairn::internal
