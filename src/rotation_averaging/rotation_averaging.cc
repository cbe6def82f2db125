#include "cairn/rotation_averaging/rotation_averaging.h"

#include <utility>

#include "cairn/base/check.h"
#include "cairn/base/named_value.h"
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "rotation_averaging/rotation_problem.h"
#include "rotation_averaging/spanning_tree.h"
#include "rotation_averaging/stages.h"

namespace cairn {
namespace {

RotationGraph MakeGraph(RotationProblem problem, std::vector<double> num_loops,
                        std::span<const char> is_root, int num_threads) {
  LaplacianSolver solver(problem.NumNodes(), problem.edges, is_root, num_threads);
  return {std::move(problem), std::move(num_loops), std::move(solver)};
}

// Images of each component.
std::vector<std::vector<image_t>> ComponentsOf(const RotationProblem& problem) {
  std::vector<std::vector<image_t>> components;
  for (const std::vector<int>& nodes :
       ConnectedComponents(problem.NumNodes(), problem.edges).nodes) {
    components.emplace_back();
    for (const int v : nodes) components.back().push_back(problem.image_ids[v]);
  }
  return components;
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
  using enum RotationAveragingStatus;
  constexpr NamedValue<RotationAveragingStatus> kNames[] = {{kSuccess, "success"},
                                                            {kNoEdges, "no_edges"},
                                                            {kNotConverged, "not_converged"},
                                                            {kInterrupted, "interrupted"}};
  return NameOf(kNames, status);
}

struct RotationAverager::Prepared {
  RotationGraph graph;
  std::vector<Eigen::Quaterniond> tree_rotations;
  std::vector<std::vector<image_t>> components;
};

RotationAverager::RotationAverager(std::span<const RotationEdge> edges, const RunContext& run)
    : prepared_([&] {
        RotationProblem problem = MakeRotationProblem(edges);
        SpanningTreeRotations tree = InitializeBySpanningTree(problem, run.num_threads);
        std::vector<std::vector<image_t>> components = ComponentsOf(problem);
        return std::make_unique<Prepared>(Prepared{
            MakeGraph(std::move(problem), std::move(tree.num_loops), tree.is_root, run.num_threads),
            std::move(tree.cam_from_world), std::move(components)});
      }()),
      run_(run) {}

RotationAverager::~RotationAverager() = default;

RotationAveragingReport RotationAverager::Average(const RotationAveragingOptions& options) {
  return Run(prepared_->tree_rotations, true, options);
}

RotationAveragingReport RotationAverager::AverageFrom(
    const std::map<image_t, Eigen::Quaterniond>& start, const RotationAveragingOptions& options) {
  std::vector<Eigen::Quaterniond> cam_from_world;
  for (const image_t id : prepared_->graph.problem.image_ids) {
    const auto rotation = start.find(id);
    CAIRN_CHECK(rotation != start.end());
    cam_from_world.push_back(rotation->second);
  }
  return Run(std::move(cam_from_world), false, options);
}

RotationAveragingReport RotationAverager::Run(std::vector<Eigen::Quaterniond> cam_from_world,
                                              bool from_tree,
                                              const RotationAveragingOptions& options) {
  ValidateOptions(options, "rotation_averaging");
  RotationProblem& problem = prepared_->graph.problem;
  RotationAveragingReport report;
  if (problem.NumEdges() == 0) return report;
  problem.SetTrust(options.weight_power);
  report.components = prepared_->components;

  StageResult l1;
  if (from_tree) l1 = RunL1Stage(prepared_->graph, options, run_, cam_from_world);
  RunConsensusStage(problem, options, run_, cam_from_world);
  RunRegionStage(prepared_->graph, options, run_, cam_from_world);
  const StageResult irls = RunIrlsStage(prepared_->graph, options, run_, cam_from_world);
  report.num_l1_iterations = l1.num_iterations;
  report.num_irls_iterations = irls.num_iterations;
  if (run_.monitor.StopRequested()) {
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
                RotationErrors(problem, cam_from_world, run_.num_threads), report);
  return report;
}

RotationAveragingReport AverageRotations(std::span<const RotationEdge> edges,
                                         const RotationAveragingOptions& options,
                                         const RunContext& run) {
  ValidateOptions(options, "rotation_averaging");
  return RotationAverager(edges, run).Average(options);
}

}  // namespace cairn
