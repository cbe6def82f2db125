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

// z = argmin |z| + |z - v|^2 / (2 * threshold).
Eigen::Vector3d Shrink(const Eigen::Vector3d& v, double threshold) {
  const double norm = v.norm();
  return norm <= threshold ? Eigen::Vector3d(0, 0, 0) : Eigen::Vector3d((1 - threshold / norm) * v);
}

// min sum_e trust_e |delta_2 - delta_1 - error_e|, started at delta = 0.
Eigen::MatrixXd SolveL1(const RotationProblem& problem, const Eigen::Matrix3Xd& errors,
                        const LaplacianSolver& solver) {
  const double threshold = DegToRad(kShrinkDeg);
  const int num_edges = problem.NumEdges();
  Eigen::Matrix3Xd dual = Eigen::Matrix3Xd::Zero(3, num_edges);
  Eigen::Matrix3Xd slack = -errors;  // residual delta_2 - delta_1 - error, where it may stay
  for (int e = 0; e < num_edges; ++e) slack.col(e) = Shrink(slack.col(e), threshold);
  Eigen::MatrixXd delta;
  for (int iteration = 0; iteration < kMaxAdmmIterations; ++iteration) {
    Eigen::MatrixXd rhs = Eigen::MatrixXd::Zero(problem.NumNodes(), 3);
    for (int e = 0; e < num_edges; ++e) {
      const Eigen::RowVector3d target =
          problem.trust[e] * (errors.col(e) + slack.col(e) - dual.col(e)).transpose();
      rhs.row(problem.edges[e].node2) += target;
      rhs.row(problem.edges[e].node1) -= target;
    }
    delta = solver.Solve(rhs);
    for (int e = 0; e < num_edges; ++e) {
      const Eigen::Vector3d residual =
          (delta.row(problem.edges[e].node2) - delta.row(problem.edges[e].node1)).transpose() -
          errors.col(e);
      const Eigen::Vector3d shifted = residual + dual.col(e);
      slack.col(e) = Shrink(shifted, threshold);
      dual.col(e) = shifted - slack.col(e);
    }
  }
  return delta;
}

}  // namespace

StageResult RunL1Stage(const RotationProblem& problem, const RotationAveragingOptions& options,
                       const RunContext& run, LaplacianSolver& solver,
                       std::vector<Eigen::Quaterniond>& cam_from_world) {
  StageResult result;
  if (options.max_l1_iterations == 0) return result;
  CAIRN_CHECK(solver.Factorize(problem.trust));
  while (result.num_iterations < options.max_l1_iterations && !run.monitor.StopRequested()) {
    const Eigen::Matrix3Xd errors = RotationErrors(problem, cam_from_world, run.num_threads);
    const double moved = ApplyRotationUpdate(SolveL1(problem, errors, solver), cam_from_world);
    ++result.num_iterations;
    result.converged =
        moved < std::max(DegToRad(kConvergenceDeg), DegToRad(options.convergence_deg));
    if (result.converged) break;
  }
  return result;
}

}  // namespace cairn
