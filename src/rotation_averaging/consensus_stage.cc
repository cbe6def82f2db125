#include "cairn/math/angles.h"
#include "graph/graph.h"
#include "rotation_averaging/stages.h"
#include "rotation_averaging/votes.h"

namespace cairn {
namespace {

// A camera moves only to a rotation that has this much more support, so that rounds end.
constexpr double kMinGain = 1.05;

}  // namespace

int RunConsensusStage(const RotationProblem& problem, const RotationAveragingOptions& options,
                      const RunContext& run, std::vector<Eigen::Quaterniond>& cam_from_world) {
  const double sigma = DegToRad(options.sigma_start_deg);
  const GraphAdjacency adjacency = BuildAdjacency(problem.NumNodes(), problem.edges);
  std::vector<char> is_open(problem.NumNodes(), 1);  // a neighbor has moved since it was looked at
  std::vector<Vote> votes;
  int num_rounds = 0;
  bool has_moved = true;
  while (has_moved && num_rounds < options.max_consensus_rounds && !run.monitor.StopRequested()) {
    ++num_rounds;
    has_moved = false;
    for (int v = 0; v < problem.NumNodes(); ++v) {
      if (!is_open[v]) continue;
      is_open[v] = 0;
      votes.clear();
      for (const int e : adjacency.EdgesOf(v)) {
        const auto [node1, node2] = problem.edges[e];
        const Eigen::Quaterniond& q = problem.relative[e];
        votes.push_back(
            {node2 == v ? q * cam_from_world[node1] : q.conjugate() * cam_from_world[node2],
             problem.trust[e]});
      }
      const Mode mode = FindMode(votes, sigma);
      if (mode.support <= kMinGain * Support(cam_from_world[v], votes, sigma)) continue;
      cam_from_world[v] = mode.rotation;
      has_moved = true;
      for (const int other : adjacency.NeighborsOf(v)) is_open[other] = 1;
    }
  }
  return num_rounds;
}

}  // namespace cairn
