#include "rotation_averaging/rotation_problem.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "cairn/math/median.h"
#include "cairn/math/so3.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

// node1 < node2, and one sign of the quaternion.
RotationEdge Canonical(const RotationEdge& edge) {
  CAIRN_CHECK_NE(edge.image_id1, edge.image_id2);
  CAIRN_CHECK(edge.weight > 0 && std::isfinite(edge.weight));
  CAIRN_CHECK(edge.cam2_from_cam1.coeffs().allFinite() && edge.cam2_from_cam1.norm() > 0);
  RotationEdge result = edge;
  result.cam2_from_cam1.normalize();
  if (result.image_id1 > result.image_id2) {
    std::swap(result.image_id1, result.image_id2);
    result.cam2_from_cam1 = result.cam2_from_cam1.conjugate();
  }
  if (result.cam2_from_cam1.w() < 0) result.cam2_from_cam1.coeffs() *= -1;
  return result;
}

}  // namespace

void RotationProblem::SetTrust(double weight_power) {
  trust.assign(weights.size(), 1.0);
  if (weight_power == 0 || weights.empty()) return;
  const double median = UpperMedian(weights);
  // (Beyond kMaxTrust, sums of weights lose the small ones, and a system its rank.)
  constexpr double kMaxTrust = 1e5;
  for (size_t e = 0; e < trust.size(); ++e) {
    trust[e] = std::clamp(std::pow(weights[e] / median, weight_power), 1 / kMaxTrust, kMaxTrust);
  }
}

RotationProblem MakeRotationProblem(std::span<const RotationEdge> input) {
  std::vector<RotationEdge> edges;
  edges.reserve(input.size());
  for (const RotationEdge& edge : input) edges.push_back(Canonical(edge));
  const auto key = [&](int e) {
    const Eigen::Quaterniond& q = edges[e].cam2_from_cam1;
    return std::make_tuple(edges[e].image_id1, edges[e].image_id2, edges[e].weight, q.w(), q.x(),
                           q.y(), q.z());
  };

  RotationProblem problem;
  for (const RotationEdge& edge : edges) {
    problem.image_ids.push_back(edge.image_id1);
    problem.image_ids.push_back(edge.image_id2);
  }
  std::vector<image_t>& ids = problem.image_ids;
  ids = Unique(std::move(ids));
  problem.edge_of_input.resize(edges.size());
  for (const int e : SortedOrder(edges.size(), key)) {
    problem.edge_of_input[e] = problem.NumEdges();
    problem.edges.push_back({IndexIn(ids, edges[e].image_id1), IndexIn(ids, edges[e].image_id2)});
    problem.relative.push_back(edges[e].cam2_from_cam1);
    problem.weights.push_back(edges[e].weight);
  }
  problem.adjacency = BuildAdjacency(problem.NumNodes(), problem.edges);
  return problem;
}

Eigen::Vector3d RotationError(const RotationProblem& problem,
                              const std::vector<Eigen::Quaterniond>& cam_from_world, int edge) {
  const auto [node1, node2] = problem.edges[edge];
  return LogSO3(cam_from_world[node2].conjugate() * problem.relative[edge] * cam_from_world[node1]);
}

Eigen::Matrix3Xd RotationErrors(const RotationProblem& problem,
                                const std::vector<Eigen::Quaterniond>& cam_from_world,
                                int num_threads) {
  constexpr int kEdgesATask = 4096;
  if (problem.NumEdges() < kMinParallelEdges) num_threads = 1;
  Eigen::Matrix3Xd errors(3, problem.NumEdges());
  const auto fill = [&](int64_t e) {
    errors.col(e) = RotationError(problem, cam_from_world, static_cast<int>(e));
  };
  ParallelFor(num_threads, problem.NumEdges(), fill, kEdgesATask);
  return errors;
}

double ApplyRotationUpdate(const Eigen::MatrixXd& delta,
                           std::vector<Eigen::Quaterniond>& cam_from_world) {
  double sum = 0;
  for (size_t v = 0; v < cam_from_world.size(); ++v) {
    const Eigen::Vector3d step = delta.row(static_cast<Eigen::Index>(v)).transpose();
    cam_from_world[v] = (cam_from_world[v] * ExpSO3(step)).normalized();
    sum += step.norm();
  }
  return cam_from_world.empty() ? 0.0 : sum / static_cast<double>(cam_from_world.size());
}

}  // namespace cairn
