#include "rotation_averaging/spanning_tree.h"

#include <algorithm>
#include <cmath>

#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"

namespace cairn {
namespace {

constexpr double kLoopErrorDeg = 5.0;
constexpr int kMaxLoops = 32;

// Neighbors of each node by increasing index, with the edge that leads there. Of parallel edges
// only the first counts.
struct SortedNeighbors {
  std::vector<std::vector<std::pair<int, int>>> of;  // (neighbor, edge)

  explicit SortedNeighbors(const RotationProblem& problem) : of(problem.NumNodes()) {
    for (int e = 0; e < problem.NumEdges(); ++e) {
      of[problem.edges[e].node1].push_back({problem.edges[e].node2, e});
      of[problem.edges[e].node2].push_back({problem.edges[e].node1, e});
    }
    for (auto& list : of) {
      std::sort(list.begin(), list.end());
      list.erase(std::unique(list.begin(), list.end(),
                             [](const auto& a, const auto& b) { return a.first == b.first; }),
                 list.end());
    }
  }
};

Eigen::Quaterniond To(const RotationProblem& problem, int edge, int node) {
  const Eigen::Quaterniond& q = problem.relative[edge];
  return problem.edges[edge].node2 == node ? q : q.conjugate();
}

}  // namespace

std::vector<int> CountConsistentLoops(const RotationProblem& problem, double max_error_deg,
                                      int max_loops, int num_threads) {
  const SortedNeighbors neighbors(problem);
  const double min_cos_half = std::cos(0.5 * DegToRad(max_error_deg));
  std::vector<int> counts(problem.NumEdges(), 0);
  const auto count = [&](int64_t e) {
    const auto [node1, node2] = problem.edges[e];
    std::vector<std::pair<int, int>> loops;  // edges node1 - k and k - node2
    auto a = neighbors.of[node1].begin();
    auto b = neighbors.of[node2].begin();
    while (a != neighbors.of[node1].end() && b != neighbors.of[node2].end()) {
      if (a->first == b->first) loops.push_back({a->second, b->second});
      const bool step_a = a->first <= b->first;
      const bool step_b = b->first <= a->first;
      a += step_a;
      b += step_b;
    }
    const size_t num = std::min<size_t>(loops.size(), max_loops);
    for (size_t k = 0; k < num; ++k) {
      const auto [edge1, edge2] = loops[k * loops.size() / num];
      const int middle = problem.edges[edge1].node1 + problem.edges[edge1].node2 - node1;
      const Eigen::Quaterniond detour = To(problem, edge2, node2) * To(problem, edge1, middle);
      counts[e] += std::abs(detour.dot(problem.relative[e])) >= min_cos_half;
    }
  };
  ParallelFor(num_threads, problem.NumEdges(), count, 256);
  return counts;
}

SpanningTreeRotations InitializeBySpanningTree(const RotationProblem& problem, int num_threads) {
  const std::vector<int> loops =
      CountConsistentLoops(problem, kLoopErrorDeg, kMaxLoops, num_threads);
  std::vector<double> weights = problem.weights;
  for (size_t e = 0; e < weights.size(); ++e) weights[e] *= 1.0 + loops[e];
  const int num_nodes = problem.NumNodes();
  const std::vector<int> forest = MaximumSpanningForest(num_nodes, problem.edges, weights);

  SpanningTreeRotations result;
  result.cam_from_world.assign(num_nodes, Eigen::Quaterniond::Identity());
  result.is_root.assign(num_nodes, 0);
  for (const ForestStep& step : WalkForest(num_nodes, problem.edges, forest)) {
    if (step.parent < 0) {
      result.is_root[step.node] = 1;
    } else {
      result.cam_from_world[step.node] =
          (To(problem, step.edge, step.node) * result.cam_from_world[step.parent]).normalized();
    }
  }
  return result;
}

}  // namespace cairn
