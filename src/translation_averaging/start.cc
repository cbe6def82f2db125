#include "translation_averaging/start.h"

#include <Eigen/LU>
#include <algorithm>

#include "cairn/base/check.h"
#include "cairn/math/decompositions.h"
#include "graph/sum_at_nodes.h"
#include "sparse/laplacian_solver.h"

namespace cairn {
namespace {

constexpr int kNumIterations = 200;
constexpr double kStartTolerance = 1e-3;  // of conjugate gradients
// Of absolute deviations; a step is known to a hundredth.
constexpr int kNumReweightings = 30;
constexpr double kLeastError = 0.01;

// min sum |x_2 - x_1 - l v|, l >= 1, over nodes 0 .. n-1 and a connected graph.
Eigen::MatrixXd SolveLud(int num_nodes, const std::vector<GraphEdge>& edges,
                         const std::vector<Eigen::Vector3d>& directions, int num_threads) {
  std::vector<char> is_gauge(num_nodes, 0);
  is_gauge[0] = 1;
  LaplacianSolver solver(num_nodes, edges, is_gauge, num_threads);
  CAIRN_CHECK(solver.Factorize(std::vector<double>(edges.size(), 1.0)));

  std::vector<Eigen::Vector3d> slack(edges.size(), Eigen::Vector3d::Zero());  // allowed errors
  std::vector<Eigen::Vector3d> dual(edges.size(), Eigen::Vector3d::Zero());
  Eigen::MatrixXd x;
  const auto solve = [&](const auto& target_of) {
    x = solver.Solve(SumAtNodes(num_nodes, edges, num_threads, target_of), x, kStartTolerance);
  };
  solve([&](int e) { return directions[e]; });
  // Errors beyond the threshold count as outliers: the shortest edges have length 1.
  constexpr double kThreshold = 1.0;
  const auto next_target = [&](int e) -> Eigen::Vector3d {
    const Eigen::Vector3d difference = (x.row(edges[e].node2) - x.row(edges[e].node1)).transpose();
    const double length = std::max(1.0, directions[e].dot(difference - slack[e] + dual[e]));
    const Eigen::Vector3d shifted = difference - length * directions[e] + dual[e];
    const double norm = shifted.norm();
    slack[e] = norm <= kThreshold ? Eigen::Vector3d(0, 0, 0)
                                  : Eigen::Vector3d((1 - kThreshold / norm) * shifted);
    dual[e] = shifted - slack[e];
    return length * directions[e] + slack[e] - dual[e];
  };
  for (int iteration = 1; iteration < kNumIterations; ++iteration) solve(next_target);
  return x;
}

double SceneScale(const Eigen::Matrix3Xd& cameras) {
  const Eigen::Vector3d center = cameras.rowwise().mean();
  return (cameras.colwise() - center).colwise().norm().mean();
}

// The cameras are the first rows.
Positions WithPoints(const DirectionProblem& problem, const Eigen::MatrixXd& x) {
  Positions positions;
  positions.cameras = x.topRows(problem.NumCameras()).transpose();
  positions.points.resize(3, problem.NumTracks());
  const double scale = SceneScale(positions.cameras);
  for (int k = 0; k < problem.NumTracks(); ++k) {
    positions.points.col(k) = PointFromRays(problem.RaysOf(k), positions.cameras, scale);
  }
  return positions;
}

}  // namespace

std::optional<Positions> StartByLengths(const DirectionProblem& problem, int num_threads) {
  std::vector<GraphEdge> edges;
  std::vector<Eigen::Vector3d> steps;
  std::vector<double> sureness;
  for (const DirectionProblem::Edge& edge : problem.edges) {
    if (!(edge.length > 0)) continue;
    edges.push_back({edge.camera1, edge.camera2});
    steps.push_back(edge.length * edge.direction);
    sureness.push_back(std::max(1, edge.num_points) / (edge.length * edge.length));
  }
  const int n = problem.NumCameras();
  if (ConnectedComponents(n, edges).Num() != 1) return std::nullopt;
  std::vector<char> is_gauge(n, 0);
  is_gauge[0] = 1;
  LaplacianSolver solver(n, edges, is_gauge, num_threads);
  std::vector<double> weights = sureness;
  Eigen::MatrixXd x;
  for (int iteration = 0; iteration < kNumReweightings; ++iteration) {
    if (!solver.Factorize(weights)) return std::nullopt;
    x = solver.Solve(SumAtNodes(n, edges, num_threads,
                                [&](int e) -> Eigen::Vector3d { return weights[e] * steps[e]; }),
                     x);
    for (size_t e = 0; e < edges.size(); ++e) {
      const Eigen::Vector3d step = (x.row(edges[e].node2) - x.row(edges[e].node1)).transpose();
      const double error = (step - steps[e]).norm() / steps[e].norm();
      weights[e] = sureness[e] / std::max(error, kLeastError);
    }
  }
  return WithPoints(problem, x);
}

Positions LeastUnsquaredDeviations(const DirectionProblem& problem, int num_threads) {
  const int n = problem.NumCameras();
  std::vector<GraphEdge> edges;
  std::vector<Eigen::Vector3d> directions;
  for (const DirectionProblem::Edge& edge : problem.edges) {
    edges.push_back({edge.camera1, edge.camera2});
    directions.push_back(edge.direction);
  }
  const bool cameras_only = ConnectedComponents(n, edges).Num() == 1;
  for (int k = 0; k < problem.NumTracks() && !cameras_only; ++k) {
    for (const DirectionProblem::Ray& ray : problem.RaysOf(k)) {
      edges.push_back({ray.camera, n + k});
      directions.push_back(ray.direction);
    }
  }
  const Eigen::MatrixXd x =
      SolveLud(cameras_only ? n : n + problem.NumTracks(), edges, directions, num_threads);
  return WithPoints(problem, x);
}

Eigen::Vector3d PointFromRays(std::span<const DirectionProblem::Ray> rays,
                              const Eigen::Matrix3Xd& cameras, double scale) {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  Eigen::Vector3d mean_direction = Eigen::Vector3d::Zero();
  for (const DirectionProblem::Ray& ray : rays) {
    const Eigen::Matrix3d P =
        Eigen::Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    A += P;
    b += P * cameras.col(ray.camera);
    center += cameras.col(ray.camera) / static_cast<double>(rays.size());
    mean_direction += ray.direction;
  }
  const auto eigen = SymmetricEigen(A);
  constexpr double kMinSquaredSine = 1e-6;  // rays within about 0.1 degrees
  if (eigen.values[0] > kMinSquaredSine * static_cast<double>(rays.size())) {
    const Eigen::Vector3d X = A.inverse() * b;
    const bool in_front = std::all_of(rays.begin(), rays.end(), [&](const auto& ray) {
      return ray.direction.dot(X - cameras.col(ray.camera)) > 0;
    });
    if (in_front) return X;
  }
  constexpr double kFar = 5.0;
  if (mean_direction.norm() < 1e-9) mean_direction = rays.front().direction;
  return center + kFar * std::max(scale, 1e-12) * mean_direction.normalized();
}

}  // namespace cairn
