#include "cairn/rotation_averaging/rotation_averaging.h"

#include <algorithm>

#include "cairn/base/check.h"
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "rotation_averaging/rotation_problem.h"
#include "rotation_averaging/stages.h"
#include "rotation_averaging/start.h"

namespace cairn {
namespace {

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
  RotationStart start = FindRotationStart(problem, options, run);
  const StageResult irls = RunIrlsStage(problem, options, run, start.solver, start.cam_from_world);
  report.num_l1_iterations = start.l1.num_iterations;
  report.num_consensus_rounds = start.num_consensus_rounds;
  report.num_irls_iterations = irls.num_iterations;
  if (run.monitor.StopRequested()) {
    report.status = RotationAveragingStatus::kInterrupted;
    return report;
  }
  const bool converged = options.max_irls_iterations > 0 ? irls.converged : start.l1.converged;
  report.status =
      converged ? RotationAveragingStatus::kSuccess : RotationAveragingStatus::kNotConverged;
  for (int v = 0; v < problem.NumNodes(); ++v) {
    report.cam_from_world[problem.image_ids[v]] = start.cam_from_world[v];
  }
  FillResiduals(problem, options.max_error_deg,
                RotationErrors(problem, start.cam_from_world, run.num_threads), report);
  return report;
}

}  // namespace cairn
