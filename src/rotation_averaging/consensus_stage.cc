#include <algorithm>
#include <cmath>

#include "cairn/math/angles.h"
#include "graph/graph.h"
#include "rotation_averaging/stages.h"

namespace cairn {
namespace {

constexpr int kMaxHypotheses = 32;  // a camera
// A camera moves only to a rotation that has this much more support, so that rounds end.
constexpr double kMinGain = 1.05;

// What one edge says about its camera, given the camera at the other end.
struct Vote {
  Eigen::Quaterniond cam_from_world;
  double trust;
};

// Support of a rotation: sum of trust / (1 + (angle / sigma)^2).
double Support(const Eigen::Quaterniond& rotation, const std::vector<Vote>& votes, double sigma) {
  double support = 0;
  for (const Vote& vote : votes) {
    const double c = vote.cam_from_world.dot(rotation);             // cos of half of the angle
    const double squared_angle = 4.0 * std::max(0.0, 1.0 - c * c);  // 4 sin^2(angle / 2)
    support += vote.trust / (1.0 + squared_angle / (sigma * sigma));
  }
  return support;
}

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
    const double present = Support(cam_from_world[v], votes, sigma);
    double best = present * kMinGain;
    int best_vote = -1;
    const size_t num = std::min<size_t>(votes.size(), kMaxHypotheses);
    for (size_t k = 0; k < num; ++k) {
      const int index = static_cast<int>(k * votes.size() / num);
      const double support = Support(votes[index].cam_from_world, votes, sigma);
      if (support > best) {
        best = support;
        best_vote = index;
      }
    }
    if (best_vote < 0) continue;
    cam_from_world[v] = votes[best_vote].cam_from_world.normalized();
    ++num_moved;
  }
  return num_moved;
}

}  // namespace cairn
