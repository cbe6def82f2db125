#include "translation_averaging/one_dsfm_filter.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

#include "cairn/base/parallel.h"
#include "cairn/base/rng.h"
#include "graph/graph.h"
#include "math/random_vectors.h"

namespace cairn {
namespace {

constexpr double kZeroWeight = 1e-9;  // what subtractions leave of a sum of projections

Eigen::Vector3d RandomAxis(uint64_t seed, int index) {
  Rng rng(seed, "1dsfm axis", index);
  while (true) {
    const Eigen::Vector3d axis = GaussianVector<3>(rng);
    if (axis.norm() > 1e-3) return axis.normalized();
  }
}

// The largest of n scores that change one at a time; of equal ones the first. (A heap that keeps
// entries out of date has one for each change.)
class Tournament {
 public:
  explicit Tournament(int n) : first_leaf_(std::bit_ceil(static_cast<unsigned>(std::max(n, 2)))) {
    score_.assign(first_leaf_, -std::numeric_limits<double>::infinity());
    winner_.resize(2 * first_leaf_);
    std::iota(winner_.begin() + first_leaf_, winner_.end(), 0);
    for (int k = first_leaf_ - 1; k > 0; --k) winner_[k] = winner_[2 * k];
  }

  int Winner() const { return winner_[1]; }

  void Set(int v, double score) {
    score_[v] = score;
    for (int k = (first_leaf_ + v) / 2; k > 0; k /= 2) {
      const int left = winner_[2 * k], right = winner_[2 * k + 1];
      winner_[k] = score_[right] > score_[left] ? right : left;
    }
  }

 private:
  const int first_leaf_;
  std::vector<double> score_;
  std::vector<int> winner_;  // of each node of a binary tree; the root is node 1
};

// What each edge counts, one on average: by its points with parallax, where these are known.
std::vector<double> VotesOf(const DirectionProblem& problem) {
  std::vector<double> votes;
  double sum = 0;
  for (const DirectionProblem::Edge& edge : problem.edges) {
    votes.push_back(std::max(1, edge.num_points));
    sum += votes.back();
  }
  for (double& vote : votes) vote *= static_cast<double>(votes.size()) / sum;
  return votes;
}

// Positions of the cameras in an order that breaks few of the projected edges. Cameras are taken
// one by one, always the one with the largest (1 + weight out) / (1 + weight in) among those left
// (Wilson and Snavely 2014, section 4.2).
std::vector<int> OrderAlongAxis(const DirectionProblem& problem, const GraphAdjacency& adjacency,
                                std::span<const double> votes, const Eigen::Vector3d& axis) {
  const int n = problem.NumCameras();
  std::vector<double> weight_in(n, 0.0), weight_out(n, 0.0);
  // Projection of edge e times its vote, positive when it leads away from `camera`.
  const auto projection = [&](int e, int camera) {
    const double p = votes[e] * axis.dot(problem.edges[e].direction);
    return problem.edges[e].camera1 == camera ? p : -p;
  };
  for (int v = 0; v < n; ++v) {
    for (const int e : adjacency.EdgesOf(v)) {
      const double p = projection(e, v);
      (p > 0 ? weight_out : weight_in)[v] += std::abs(p);
    }
  }
  Tournament tournament(n);
  const auto set_score = [&](int v) {
    tournament.Set(v, weight_in[v] < kZeroWeight ? std::numeric_limits<double>::infinity()
                                                 : (1 + weight_out[v]) / (1 + weight_in[v]));
  };
  for (int v = 0; v < n; ++v) set_score(v);
  std::vector<int> position(n, -1);
  for (int num_placed = 0; num_placed < n; ++num_placed) {
    const int v = tournament.Winner();
    position[v] = num_placed;
    tournament.Set(v, -std::numeric_limits<double>::infinity());
    for (int k = adjacency.begin[v]; k < adjacency.begin[v + 1]; ++k) {
      const int u = adjacency.neighbor[k];
      if (position[u] >= 0) continue;
      const double p = projection(adjacency.edge[k], v);
      (p > 0 ? weight_in : weight_out)[u] -= std::abs(p);
      set_score(u);
    }
  }
  return position;
}

}  // namespace

std::vector<double> OneDsfmInconsistency(const DirectionProblem& problem, int num_axes,
                                         uint64_t seed, int num_threads) {
  std::vector<GraphEdge> edges;
  for (const DirectionProblem::Edge& edge : problem.edges) {
    edges.push_back({edge.camera1, edge.camera2});
  }
  const GraphAdjacency adjacency = BuildAdjacency(problem.NumCameras(), edges);
  const std::vector<double> votes = VotesOf(problem);
  std::vector<Eigen::Vector3d> axes(num_axes);
  std::vector<std::vector<int>> positions(num_axes);
  ParallelFor(num_threads, num_axes, [&](int64_t a) {
    axes[a] = RandomAxis(seed, static_cast<int>(a));
    positions[a] = OrderAlongAxis(problem, adjacency, votes, axes[a]);
  });
  std::vector<double> inconsistency(edges.size(), 0.0);
  for (size_t e = 0; e < edges.size(); ++e) {
    for (int a = 0; a < num_axes; ++a) {
      const double p = axes[a].dot(problem.edges[e].direction);
      const int step = positions[a][edges[e].node2] - positions[a][edges[e].node1];
      if ((p > 0) != (step > 0)) inconsistency[e] += std::abs(p) / num_axes;
    }
  }
  return inconsistency;
}

}  // namespace cairn
