#include "rotation_averaging/spanning_tree.h"

#include <cmath>

#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"

namespace cairn {
namespace {

constexpr double kLoopErrorDeg = 5.0;
constexpr int kMaxLoops = 32;

Eigen::Quaterniond To(const RotationProblem& problem, int edge, int node) {
  const Eigen::Quaterniond& q = problem.relative[edge];
  return problem.edges[edge].node2 == node ? q : q.conjugate();
}

struct Loops {
  int num_consistent = 0;  // of those looked at
  double estimate = 0;     // of all
};

std::vector<Loops> CountConsistentLoops(const RotationProblem& problem, int num_threads) {
  std::vector<LoopFinder> finders(EffectiveNumThreads(num_threads),
                                  LoopFinder(problem.NumNodes(), problem.edges));
  const double min_cos_half = std::cos(0.5 * DegToRad(kLoopErrorDeg));
  std::vector<Loops> loops(problem.NumEdges());
  const auto count = [&](int worker, int64_t e) {
    const auto [node1, node2] = problem.edges[e];
    int num_all = 0;
    const auto corners = finders[worker].Find(node1, node2, kMaxLoops, &num_all);
    for (const LoopFinder::Corner& corner : corners) {
      const Eigen::Quaterniond detour =
          To(problem, corner.edge2, node2) * To(problem, corner.edge1, corner.node);
      loops[e].num_consistent += std::abs(detour.dot(problem.relative[e])) >= min_cos_half;
    }
    if (corners.empty()) return;
    loops[e].estimate =
        static_cast<double>(loops[e].num_consistent) * num_all / std::ssize(corners);
  };
  ParallelForWorker(num_threads, problem.NumEdges(), count, 256);
  return loops;
}

}  // namespace

SpanningTreeRotations InitializeBySpanningTree(const RotationProblem& problem, int num_threads) {
  const std::vector<Loops> loops = CountConsistentLoops(problem, num_threads);
  std::vector<double> weights = problem.weights;
  SpanningTreeRotations result;
  for (size_t e = 0; e < weights.size(); ++e) {
    weights[e] *= 1.0 + loops[e].num_consistent;
    result.num_loops.push_back(loops[e].estimate);
  }
  const int num_nodes = problem.NumNodes();
  const std::vector<int> forest = MaximumSpanningForest(num_nodes, problem.edges, weights);

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
