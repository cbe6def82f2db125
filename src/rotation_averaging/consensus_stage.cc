#include "cairn/math/angles.h"
#include "graph/graph.h"
#include "rotation_averaging/stages.h"
#include "rotation_averaging/votes.h"

namespace cairn {
namespace {

// A camera moves only to a rotation that has this much more support, so that rounds end.
constexpr double kMinGain = 1.05;

}  // namespace

int RunConsensusRound(const RotationProblem& problem, double sigma_deg,
                      std::vector<Eigen::Quaterniond>& cam_from_world) {
  const double sigma = DegToRad(sigma_deg);
  const GraphAdjacency adjacency = BuildAdjacency(problem.NumNodes(), problem.edges);
  int num_moved = 0;
  std::vector<Vote> votes;
  for (int v = 0; v < problem.NumNodes(); ++v) {
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
    ++num_moved;
  }
  return num_moved;
}

}  // namespace cairn
