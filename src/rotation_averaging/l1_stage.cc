#include <algorithm>

#include "cairn/base/check.h"
#include "cairn/math/angles.h"
#include "rotation_averaging/stages.h"

namespace cairn {
namespace {

constexpr int kMaxAdmmIterations = 12;
// The step of the dual, 1 / rho: errors beyond it count as outliers from the first iteration.
constexpr double kShrinkDeg = 2.0;
constexpr double kConvergenceDeg = 0.05;
// Of a step within ADMM, where conjugate gradients make it: the next one mends what it leaves.
constexpr double kSolverTolerance = 1e-2;

// z = argmin |z| + |z - v|^2 / (2 * threshold).
Eigen::Vector3d Shrink(const Eigen::Vector3d& v, double threshold) {
  const double norm = v.norm();
  return norm <= threshold ? Eigen::Vector3d(0, 0, 0) : Eigen::Vector3d((1 - threshold / norm) * v);
}

// min sum_e trust_e |delta_2 - delta_1 - error_e|, started at delta = 0.
Eigen::MatrixXd SolveL1(const RotationProblem& problem, const Eigen::Matrix3Xd& errors,
                        const LaplacianSolver& solver, int num_threads) {
  const double threshold = DegToRad(kShrinkDeg);
  Eigen::Matrix3Xd dual = Eigen::Matrix3Xd::Zero(3, problem.NumEdges());
  // Where the difference of an edge's ends should be, times its trust: error + slack - dual, with
  // the slack where the residual delta_2 - delta_1 - error may stay.
  const auto first_target = [&](int e) -> Eigen::Vector3d {
    return problem.trust[e] * (errors.col(e) + Shrink(-errors.col(e), threshold));
  };
  const auto sum_at_nodes = [&](const auto& vector_of) {
    return SumAtNodes(problem.NumNodes(), problem.edges, num_threads, vector_of);
  };
  Eigen::MatrixXd delta = solver.Solve(sum_at_nodes(first_target), {}, kSolverTolerance);
  const auto target = [&](int e) -> Eigen::Vector3d {
    const auto [node1, node2] = problem.edges[e];
    const Eigen::Vector3d residual =
        (delta.row(node2) - delta.row(node1)).transpose() - errors.col(e);
    const Eigen::Vector3d shifted = residual + dual.col(e);
    const Eigen::Vector3d slack = Shrink(shifted, threshold);
    dual.col(e) = shifted - slack;
    return problem.trust[e] * (errors.col(e) + slack - dual.col(e));
  };
  for (int iteration = 1; iteration < kMaxAdmmIterations; ++iteration) {
    delta = solver.Solve(sum_at_nodes(target), delta, kSolverTolerance);
  }
  return delta;
}

}  // namespace

StageResult RunL1Stage(RotationGraph& graph, const RotationAveragingOptions& options,
                       const RunContext& run, std::vector<Eigen::Quaterniond>& cam_from_world) {
  const RotationProblem& problem = graph.problem;
  StageResult result;
  if (options.max_l1_iterations == 0) return result;
  CAIRN_CHECK(graph.solver.Factorize(problem.trust));
  while (result.num_iterations < options.max_l1_iterations && !run.monitor.StopRequested()) {
    const Eigen::Matrix3Xd errors = RotationErrors(problem, cam_from_world, run.num_threads);
    const double moved = ApplyRotationUpdate(
        SolveL1(problem, errors, graph.solver, run.num_threads), cam_from_world);
    ++result.num_iterations;
    result.converged =
        moved < std::max(DegToRad(kConvergenceDeg), DegToRad(options.convergence_deg));
    if (result.converged) break;
  }
  return result;
}

}  // namespace cairn
