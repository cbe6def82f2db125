#include "rotation_averaging/start.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>

#include "cairn/math/angles.h"
#include "rotation_averaging/spanning_tree.h"
#include "rotation_averaging/votes.h"

namespace cairn {
namespace {

// Weights change in every iteration: beyond some half second for a factorization, conjugate
// gradients are taken.
constexpr double kMaxCholeskyFlops = 3e9;
constexpr int kMaxSweeps = 20;
// Of two groups, one edge decides nothing.
constexpr int kMinGroups = 3;

RotationStart AverageFlat(const RotationProblem& problem, const RotationAveragingOptions& options,
                          const RunContext& run) {
  SpanningTreeRotations tree = InitializeBySpanningTree(problem, run.num_threads);
  std::vector<LaplacianSolver::Edge> edges;
  edges.reserve(problem.edges.size());
  for (const GraphEdge& edge : problem.edges) edges.push_back({edge.node1, edge.node2});
  RotationStart start{
      std::move(tree.cam_from_world),
      LaplacianSolver(problem.NumNodes(), edges, tree.is_root, kMaxCholeskyFlops, run.num_threads)};
  start.l1 = RunL1Stage(problem, options, run, start.solver, start.cam_from_world);
  start.num_consensus_rounds = RunConsensusStage(problem, options, run, start.cam_from_world);
  return start;
}

double SupportOf(const RotationProblem& problem,
                 const std::vector<Eigen::Quaterniond>& cam_from_world, double sigma,
                 int num_threads) {
  const Eigen::Matrix3Xd errors = RotationErrors(problem, cam_from_world, num_threads);
  double support = 0;
  for (int e = 0; e < problem.NumEdges(); ++e) {
    support += problem.trust[e] / (1.0 + errors.col(e).squaredNorm() / (sigma * sigma));
  }
  return support;
}

// Cameras that hang together: each takes the label that its edges give the most weight (Raghavan et
// al., "Near linear time algorithm to detect community structures", 2007), in the order of nodes,
// of those with room (Meyerhenke et al., "Partitioning complex networks via size-constrained
// clustering", 2014).
GraphComponents FindGroups(const RotationProblem& problem, int max_size) {
  const GraphAdjacency adjacency = BuildAdjacency(problem.NumNodes(), problem.edges);
  std::vector<int> label(problem.NumNodes());
  std::iota(label.begin(), label.end(), 0);
  std::vector<int> size(problem.NumNodes(), 1);
  std::map<int, double> weight_of;
  bool has_changed = true;
  for (int sweep = 0; sweep < kMaxSweeps && has_changed; ++sweep) {
    has_changed = false;
    for (int v = 0; v < problem.NumNodes(); ++v) {
      weight_of.clear();
      const std::span<const int> edges = adjacency.EdgesOf(v), others = adjacency.NeighborsOf(v);
      for (size_t k = 0; k < edges.size(); ++k) {
        weight_of[label[others[k]]] += problem.weights[edges[k]];
      }
      const auto own = weight_of.find(label[v]);
      double most = own == weight_of.end() ? 0.0 : own->second;
      int best = label[v];
      for (const auto& [other, weight] : weight_of) {
        if (weight <= most || size[other] >= max_size) continue;
        most = weight;
        best = other;
      }
      if (best == label[v]) continue;
      --size[label[v]];
      ++size[best];
      label[v] = best;
      has_changed = true;
    }
  }
  std::vector<GraphEdge> inside;
  for (const GraphEdge& edge : problem.edges) {
    if (label[edge.node1] == label[edge.node2]) inside.push_back(edge);
  }
  return ConnectedComponents(problem.NumNodes(), inside);
}

// The edges within groups.
RotationProblem ProblemWithin(const RotationProblem& problem, const std::vector<int>& group_of) {
  RotationProblem within;
  within.image_ids = problem.image_ids;
  for (int e = 0; e < problem.NumEdges(); ++e) {
    if (group_of[problem.edges[e].node1] != group_of[problem.edges[e].node2]) continue;
    within.edges.push_back(problem.edges[e]);
    within.relative.push_back(problem.relative[e]);
    within.weights.push_back(problem.weights[e]);
    within.trust.push_back(problem.trust[e]);
  }
  return within;
}

// An edge for every two groups with edges between: their mode, given the rotations within. It
// counts once, however many they are, since they are right or wrong together.
std::vector<RotationEdge> EdgesBetween(const RotationProblem& problem,
                                       const std::vector<int>& group_of,
                                       const std::vector<Eigen::Quaterniond>& cam_from_group,
                                       double sigma) {
  std::map<std::pair<int, int>, std::vector<Vote>> votes;
  for (int e = 0; e < problem.NumEdges(); ++e) {
    const auto [v1, v2] = problem.edges[e];
    const int group1 = group_of[v1], group2 = group_of[v2];
    if (group1 == group2) continue;
    const Eigen::Quaterniond group2_from_group1 =
        cam_from_group[v2].conjugate() * problem.relative[e] * cam_from_group[v1];
    if (group1 < group2) {
      votes[{group1, group2}].push_back({group2_from_group1, problem.weights[e]});
    } else {
      votes[{group2, group1}].push_back({group2_from_group1.conjugate(), problem.weights[e]});
    }
  }
  std::vector<RotationEdge> edges;
  for (const auto& [groups, of_pair] : votes) {
    const Mode mode = FindMode(of_pair, sigma);
    edges.push_back({static_cast<image_t>(groups.first), static_cast<image_t>(groups.second),
                     mode.rotation, mode.support});
  }
  return edges;
}

std::optional<std::vector<Eigen::Quaterniond>> AverageByGroups(
    const RotationProblem& problem, int max_size, const RotationAveragingOptions& options,
    const RunContext& run) {
  const GraphComponents groups = FindGroups(problem, max_size);
  if (groups.Num() < kMinGroups || groups.Num() == problem.NumNodes()) return std::nullopt;
  const std::vector<int>& group_of = groups.component_of_node;
  std::vector<Eigen::Quaterniond> rotations =
      AverageFlat(ProblemWithin(problem, group_of), options, run).cam_from_world;
  const RotationProblem between = MakeRotationProblem(
      EdgesBetween(problem, group_of, rotations, DegToRad(options.sigma_start_deg)), 0.0);
  if (between.NumEdges() == 0) return std::nullopt;
  const RotationStart start = FindRotationStart(between, options, run);
  std::vector<Eigen::Quaterniond> group_from_world(groups.Num(), Eigen::Quaterniond::Identity());
  for (int k = 0; k < between.NumNodes(); ++k) {
    group_from_world[between.image_ids[k]] = start.cam_from_world[k];
  }
  for (int v = 0; v < problem.NumNodes(); ++v) {
    rotations[v] = (rotations[v] * group_from_world[group_of[v]]).normalized();
  }
  RunConsensusStage(problem, options, run, rotations);  // cameras of groups that mix two places
  return rotations;
}

}  // namespace

RotationStart FindRotationStart(const RotationProblem& problem,
                                const RotationAveragingOptions& options, const RunContext& run) {
  RotationStart start = AverageFlat(problem, options, run);
  const double sigma = DegToRad(options.sigma_start_deg);
  double support = SupportOf(problem, start.cam_from_world, sigma, run.num_threads);
  // Groups as they are, and so many that they outvote those that look alike.
  const int balanced = static_cast<int>(std::ceil(2.0 * std::sqrt(problem.NumNodes())));
  for (const int max_size : {problem.NumNodes(), balanced}) {
    auto rotations = AverageByGroups(problem, max_size, options, run);
    if (!rotations) continue;
    const double by_groups = SupportOf(problem, *rotations, sigma, run.num_threads);
    if (by_groups <= support) continue;
    support = by_groups;
    start.cam_from_world = std::move(*rotations);
  }
  return start;
}

}  // namespace cairn
