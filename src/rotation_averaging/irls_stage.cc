#include <algorithm>

#include "cairn/base/check.h"
#include "cairn/math/angles.h"
#include "rotation_averaging/stages.h"

namespace cairn {
namespace {

// No edge counts less than this, relative to a perfect one, so that a part of the graph that only
// bad edges hold does not come loose numerically.
constexpr double kMinWeight = 1e-8;

// Where conjugate gradients solve: the next iteration mends what they leave.
constexpr double kStepTolerance = 1e-3;

// Weight of an error of norm r in the next least-squares solve, 1 at r = 0.
double KernelWeight(double squared_error, double sigma) {
  // Geman-McClure: rho = r^2 / (r^2 + sigma^2).
  const double u = 1.0 / (1.0 + squared_error / (sigma * sigma));
  return std::max(kMinWeight, u * u);
}

}  // namespace

StageResult RunIrlsStage(RotationGraph& graph, const RotationAveragingOptions& options,
                         const RunContext& run, std::vector<Eigen::Quaterniond>& cam_from_world) {
  const RotationProblem& problem = graph.problem;
  StageResult result;
  const double sigma_end = DegToRad(std::min(options.sigma_end_deg, options.sigma_start_deg));
  double sigma = DegToRad(options.sigma_start_deg);
  std::vector<double> weights(problem.NumEdges());
  while (result.num_iterations < options.max_irls_iterations && !run.monitor.StopRequested()) {
    const Eigen::MatrixXd rhs =
        SumAtNodes(problem.NumNodes(), problem.edges, run.num_threads, [&](int e) {
          const Eigen::Vector3d error = RotationError(problem, cam_from_world, e);
          weights[e] = problem.trust[e] * KernelWeight(error.squaredNorm(), sigma);
          return Eigen::Vector3d(weights[e] * error);
        });
    CAIRN_CHECK(graph.solver.Factorize(weights));
    const double moved =
        ApplyRotationUpdate(graph.solver.Solve(rhs, {}, kStepTolerance), cam_from_world);
    ++result.num_iterations;
    if (sigma <= sigma_end && moved < DegToRad(options.convergence_deg)) {
      result.converged = true;
      break;
    }
    sigma = std::max(sigma_end, sigma * options.sigma_decay);
  }
  return result;
}

}  // namespace cairn
