#include "cairn/rotation_averaging/rotation_averaging.h"

#include <algorithm>

#include "cairn/base/check.h"
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "rotation_averaging/rotation_problem.h"
#include "rotation_averaging/spanning_tree.h"
#include "rotation_averaging/stages.h"

namespace cairn {
namespace {

// Weights change in every iteration: beyond some half second for a factorization, conjugate
// gradients are taken.
constexpr double kMaxCholeskyFlops = 3e9;

LaplacianSolver MakeSolver(const RotationProblem& problem, std::span<const char> is_root,
                           int num_threads) {
  std::vector<LaplacianSolver::Edge> edges;
  edges.reserve(problem.edges.size());
  for (const GraphEdge& edge : problem.edges) edges.push_back({edge.node1, edge.node2});
  return {problem.NumNodes(), edges, is_root, kMaxCholeskyFlops, num_threads};
}

void FillResiduals(const RotationProblem& problem, double max_error_deg,
                   const Eigen::Matrix3Xd& errors, RotationAveragingReport& report) {
  for (const int e : problem.edge_of_input) {
    const double residual_deg = RadToDeg(errors.col(e).norm());
    const bool rejected = residual_deg > max_error_deg;
    report.edge_residuals_deg.push_back(residual_deg);
    report.edge_rejected.push_back(rejected);
    report.num_rejected += rejected;
  }
  report.median_residual_deg = UpperMedian(report.edge_residuals_deg);
}

}  // namespace

std::string_view RotationAveragingStatusName(RotationAveragingStatus status) {
  switch (status) {
    case RotationAveragingStatus::kSuccess:
      return "success";
    case RotationAveragingStatus::kNoEdges:
      return "no_edges";
    case RotationAveragingStatus::kNotConverged:
      return "not_converged";
    case RotationAveragingStatus::kInterrupted:
      return "interrupted";
  }
  return "unknown";
}

RotationAveragingReport AverageRotations(std::span<const RotationEdge> edges,
                                         const RotationAveragingOptions& options,
                                         const RunContext& run) {
  ValidateOptions(options, "rotation_averaging");
  RotationAveragingReport report;
  const RotationProblem problem = MakeRotationProblem(edges, options.weight_power);
  if (problem.NumEdges() == 0) return report;

  for (const std::vector<int>& nodes :
       ConnectedComponents(problem.NumNodes(), problem.edges).nodes) {
    report.components.emplace_back();
    for (const int v : nodes) report.components.back().push_back(problem.image_ids[v]);
  }
  SpanningTreeRotations tree = InitializeBySpanningTree(problem, run.num_threads);
  std::vector<Eigen::Quaterniond>& cam_from_world = tree.cam_from_world;
  LaplacianSolver solver = MakeSolver(problem, tree.is_root, run.num_threads);
  const StageResult l1 = RunL1Stage(problem, options, run, solver, cam_from_world);
  report.num_consensus_rounds = RunConsensusStage(problem, options, run, cam_from_world);
  report.num_region_rounds =
      RunRegionStage(problem, tree.num_loops, options, run, solver, cam_from_world);
  const StageResult irls = RunIrlsStage(problem, options, run, solver, cam_from_world);
  report.num_l1_iterations = l1.num_iterations;
  report.num_irls_iterations = irls.num_iterations;
  if (run.monitor.StopRequested()) {
    report.status = RotationAveragingStatus::kInterrupted;
    return report;
  }
  const bool converged = options.max_irls_iterations > 0 ? irls.converged : l1.converged;
  report.status =
      converged ? RotationAveragingStatus::kSuccess : RotationAveragingStatus::kNotConverged;
  for (int v = 0; v < problem.NumNodes(); ++v) {
    report.cam_from_world[problem.image_ids[v]] = cam_from_world[v];
  }
  FillResiduals(problem, options.max_error_deg,
                RotationErrors(problem, cam_from_world, run.num_threads), report);
  return report;
}

}  // namespace cairn
