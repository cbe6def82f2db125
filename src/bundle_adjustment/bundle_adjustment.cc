#include "cairn/bundle_adjustment/bundle_adjustment.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "bundle_adjustment/bundle_state.h"
#include "bundle_adjustment/intrinsics_prior.h"
#include "bundle_adjustment/large_bundle.h"
#include "bundle_adjustment/reprojection_cost.h"
#include "bundle_adjustment/schur_solver.h"
#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "cairn/base/timer.h"

namespace cairn {
namespace {

std::unique_ptr<ceres::LossFunction> MakeLoss(const BundleAdjustmentOptions& options) {
  switch (options.loss) {
    case ReprojectionLoss::kNone:
      return nullptr;
    case ReprojectionLoss::kSoftL1:
      return std::make_unique<ceres::SoftLOneLoss>(options.loss_scale);
    case ReprojectionLoss::kHuber:
      return std::make_unique<ceres::HuberLoss>(options.loss_scale);
    case ReprojectionLoss::kCauchy:
      return std::make_unique<ceres::CauchyLoss>(options.loss_scale);
  }
  return nullptr;
}

// Other images that see an observation's point, on average: how many blocks of the cameras' system
// one observation takes part in.
double MeanCovisibility(const Reconstruction& reconstruction) {
  double observations = 0, pairs = 0;
  for (const auto& [id, point] : reconstruction.points3D) {
    const auto n = static_cast<double>(point.track.size());
    observations += n;
    pairs += n * n;
  }
  return observations > 0 ? pairs / observations : 0.0;
}

BundleSolver ChooseSolver(const BundleAdjustmentOptions& options,
                          const BundleAdjustmentScope& scope, int64_t num_images,
                          double covisibility) {
  // Without points, or with nothing but points, there is nothing to eliminate.
  const bool has_others =
      scope.rotations || scope.positions || scope.focal_lengths || scope.distortions;
  if (!scope.points || !has_others) return BundleSolver::kSparseNormalCholesky;
  return SchurSolver(options, num_images, covisibility);
}

ceres::LinearSolverType CeresSolverType(BundleSolver solver) {
  if (solver == BundleSolver::kDenseSchur) return ceres::DENSE_SCHUR;
  if (solver == BundleSolver::kSparseSchur) return ceres::SPARSE_SCHUR;
  if (solver == BundleSolver::kIterativeSchur) return ceres::ITERATIVE_SCHUR;
  return ceres::SPARSE_NORMAL_CHOLESKY;
}

class StopCallback : public ceres::IterationCallback {
 public:
  explicit StopCallback(ProgressMonitor& monitor) : monitor_(monitor) {}
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    if (!monitor_.StopRequested()) return ceres::SOLVER_CONTINUE;
    stopped_ = true;
    return ceres::SOLVER_TERMINATE_SUCCESSFULLY;
  }
  bool stopped() const { return stopped_; }

 private:
  ProgressMonitor& monitor_;
  bool stopped_ = false;
};

// The Ceres problem over a BundleState, with what it must not outlive.
class BundleProblem {
 public:
  BundleProblem(const BundleAdjustmentOptions& options, const BundleAdjustmentScope& scope,
                const Reconstruction& reconstruction)
      : state_(scope, reconstruction), loss_(MakeLoss(options)), problem_(ProblemOptions()) {
    ordering_ = std::make_shared<ceres::ParameterBlockOrdering>();
    size_t index = 0;
    for (const auto& [id, point] : reconstruction.points3D) {
      AddPoint(scope, reconstruction, point, state_.Point(index++));
    }
    for (const auto& [id, prior] : scope.priors) {
      const auto camera = reconstruction.cameras.find(id);
      if (camera == reconstruction.cameras.end()) continue;
      AddPrior(camera->second, prior, state_.Intrinsics(id));
    }
    for (const SurveyedPoint& point : scope.surveyed_points) {
      AddSurveyedPoint(scope, reconstruction, point, state_.Point(index++));
    }
    for (const auto& [id, prior] : scope.image_positions) {
      if (!scope.positions || reconstruction.images.count(id) == 0) continue;
      double* const block = state_.Pose(id).block.data();
      AddPositionPrior(prior, scope.rotations ? 3 : 0, block + (scope.rotations ? 0 : 3));
    }
  }

  ceres::Solver::Summary Solve(ceres::Solver::Options options) {
    if (options.linear_solver_type != ceres::SPARSE_NORMAL_CHOLESKY) {
      options.linear_solver_ordering = ordering_;
    }
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem_, &summary);
    return summary;
  }
  int64_t num_observations() const { return num_observations_; }
  int64_t num_points() const { return num_points_; }
  const BundleState& state() const { return state_; }

 private:
  ceres::Problem::Options ProblemOptions() {
    ceres::Problem::Options options;
    options.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    options.evaluation_callback = &state_;
    options.disable_all_safety_checks = true;
    return options;
  }

  void AddPoint(const BundleAdjustmentScope& scope, const Reconstruction& reconstruction,
                const Point3D& point, Eigen::Vector3d& xyz) {
    int num_used = 0;
    for (const TrackElement& element : point.track) {
      const RegisteredImage& image = reconstruction.images.at(element.image_id);
      const double sigma_px = image.sigmas_px.empty() ? 1.0 : image.sigmas_px[element.point2D];
      num_used += AddObservation(scope, reconstruction, element.image_id,
                                 image.points2D[element.point2D], sigma_px, loss_.get(), xyz);
    }
    num_observations_ += num_used;
    num_points_ += num_used > 0;
  }

  // False: nothing of it is free, or the point is not in front of the camera.
  bool AddObservation(const BundleAdjustmentScope& scope, const Reconstruction& reconstruction,
                      image_t id, const Eigen::Vector2d& pixel, double sigma_px,
                      ceres::LossFunction* loss, Eigen::Vector3d& xyz) {
    const RegisteredImage& image = reconstruction.images.at(id);
    if (!reconstruction.CameraOf(image).ImgFromRay(image.cam_from_world * xyz)) return false;
    PoseState& pose = state_.Pose(id);
    IntrinsicsState& intrinsics = *pose.intrinsics;
    const bool pose_is_free = scope.fixed_images.count(id) == 0;
    const Reprojection::Free free{.point = scope.points,
                                  .rotation = scope.rotations && pose_is_free,
                                  .position = scope.positions && pose_is_free};
    parameters_.clear();
    if (free.point) Use(0, xyz.data());
    if (free.rotation || free.position) Use(1, pose.block.data() + (free.rotation ? 0 : 3));
    if (intrinsics.num_free > 0) Use(2, intrinsics.free.data());
    if (parameters_.empty()) return false;
    auto cost =
        std::make_unique<ReprojectionCost>(Reprojection{&pose, &xyz, pixel, 1.0 / sigma_px, free});
    problem_.AddResidualBlock(cost.release(), loss, parameters_);
    return true;
  }

  void AddSurveyedPoint(const BundleAdjustmentScope& scope, const Reconstruction& reconstruction,
                        const SurveyedPoint& point, Eigen::Vector3d& xyz) {
    for (const auto& [id, pixel] : point.pixels) {
      AddObservation(scope, reconstruction, id, pixel, 1.0, &position_loss_, xyz);
    }
    AddPositionPrior(point.prior, 0, xyz.data());
  }

  // Of the three coordinates that begin at `offset` in a block of offset + 3.
  void AddPositionPrior(const PositionPrior& prior, int offset, double* block) {
    if (!problem_.HasParameterBlock(block)) return;
    ceres::Matrix A = ceres::Matrix::Zero(3, offset + 3);
    ceres::Vector b = ceres::Vector::Zero(offset + 3);
    A.rightCols(3) = prior.precision.asDiagonal();
    b.tail(3) = prior.position;
    problem_.AddResidualBlock(new ceres::NormalPrior(A, b), &position_loss_, block);
  }

  void AddPrior(const Camera& camera, const IntrinsicsPrior& prior, IntrinsicsState& state) {
    if (!problem_.HasParameterBlock(state.free.data())) return;
    const FreeIntrinsicsPrior of_free = PriorOfFree(camera, prior, state);
    problem_.AddResidualBlock(
        new ceres::NormalPrior(ceres::Matrix(of_free.precision.asDiagonal()), of_free.mean),
        nullptr, state.free.data());
  }

  // Within a group Ceres orders blocks by address: so a group is one array (see BundleState).
  void Use(int group, double* block) {
    parameters_.push_back(block);
    ordering_->AddElementToGroup(block, group);
  }

  BundleState state_;
  std::unique_ptr<ceres::LossFunction> loss_;
  ceres::HuberLoss position_loss_{kPositionLossScale};
  ceres::Problem problem_;
  std::shared_ptr<ceres::ParameterBlockOrdering> ordering_;
  std::vector<double*> parameters_;
  int64_t num_observations_ = 0;
  int64_t num_points_ = 0;
};

ceres::Solver::Options SolverOptions(const BundleAdjustmentOptions& options, BundleSolver solver,
                                     int num_threads) {
  ceres::Solver::Options ceres_options;
  ceres_options.linear_solver_type = CeresSolverType(solver);
  ceres_options.preconditioner_type = ceres::SCHUR_JACOBI;
  ceres_options.max_num_iterations = options.max_iterations;
  ceres_options.gradient_tolerance = 1e-12;
  ceres_options.parameter_tolerance = 1e-10;
  ceres_options.max_num_consecutive_invalid_steps = 10;
  ceres_options.max_linear_solver_iterations = 200;
  // Ceres warns when asked for more threads than there are.
  ceres_options.num_threads = std::min(EffectiveNumThreads(num_threads), EffectiveNumThreads(0));
  ceres_options.logging_type = ceres::SILENT;
  return ceres_options;
}

// How an adjustment begins and ends.
struct Tempo {
  double initial_damping = 1e-4;  // as Ceres has it
  double tolerance = 0;
};
// The damping never vanishes, since it alone holds the world frame.
constexpr double kMinDamping = 1e-9;

Tempo TempoOf(const BundleAdjustmentOptions& options, const BundleAdjustmentScope& scope,
              int64_t num_observations) {
  const auto num_positions =
      static_cast<double>(scope.image_positions.size() + scope.surveyed_points.size());
  Tempo tempo{.tolerance = options.function_tolerance};
  if (num_positions > 0) {
    // Positions hold the world frame, and the initial damping would be stiffer than they are. What
    // they still bring is small beside the cost of all observations.
    tempo.initial_damping = kMinDamping;
    tempo.tolerance *= num_positions / (num_positions + static_cast<double>(num_observations));
  }
  return tempo;
}

void SetRmse(double initial_cost, double final_cost, BundleAdjustmentReport& report) {
  const auto rmse = [&](double cost) {
    return std::sqrt(2.0 * cost / static_cast<double>(report.num_observations));
  };
  report.initial_rmse = rmse(initial_cost);
  report.final_rmse = rmse(final_cost);
}

BundleAdjustmentReport AdjustByCeres(const BundleAdjustmentOptions& options,
                                     const BundleAdjustmentScope& scope, BundleSolver solver,
                                     const RunContext& run, Reconstruction& reconstruction) {
  BundleProblem problem(options, scope, reconstruction);
  BundleAdjustmentReport report;
  report.num_points = problem.num_points();
  report.num_observations = problem.num_observations();
  if (report.num_observations == 0) return report;
  ceres::Solver::Options solver_options = SolverOptions(options, solver, run.num_threads);
  const Tempo tempo = TempoOf(options, scope, report.num_observations);
  solver_options.initial_trust_region_radius = 1.0 / tempo.initial_damping;
  solver_options.max_trust_region_radius = 1.0 / kMinDamping;
  solver_options.function_tolerance = tempo.tolerance;
  StopCallback stop(run.monitor);
  solver_options.callbacks.push_back(&stop);
  const ceres::Solver::Summary summary = problem.Solve(solver_options);
  report.num_iterations = static_cast<int>(summary.iterations.size());
  SetRmse(summary.initial_cost, summary.final_cost, report);
  report.status = BundleAdjustmentStatus::kFailed;
  if (!summary.IsSolutionUsable()) return report;
  problem.state().Store(scope, reconstruction);
  report.status = stop.stopped() ? BundleAdjustmentStatus::kStopped
                  : summary.termination_type == ceres::CONVERGENCE
                      ? BundleAdjustmentStatus::kConverged
                      : BundleAdjustmentStatus::kMaxIterations;
  return report;
}

BundleAdjustmentReport AdjustByRows(const BundleAdjustmentOptions& options,
                                    const BundleAdjustmentScope& scope, const RunContext& run,
                                    Reconstruction& reconstruction) {
  BundleState state(scope, reconstruction);
  const Tempo tempo = TempoOf(options, scope, reconstruction.NumObservations());
  const auto loss = MakeLoss(options);
  const LargeBundleReport large = AdjustLargeBundle({.max_iterations = options.max_iterations,
                                                     .min_relative_gain = tempo.tolerance,
                                                     .initial_damping = tempo.initial_damping},
                                                    scope, reconstruction, loss.get(), run, state);
  BundleAdjustmentReport report;
  report.num_points = large.num_points;
  report.num_observations = large.num_observations;
  if (report.num_observations == 0) return report;
  report.num_iterations = large.solution.num_iterations;
  SetRmse(large.initial_cost, large.solution.cost, report);
  report.status = BundleAdjustmentStatus::kFailed;
  if (!std::isfinite(large.solution.cost)) return report;
  state.Store(scope, reconstruction);
  report.status = run.monitor.StopRequested() ? BundleAdjustmentStatus::kStopped
                  : report.num_iterations < options.max_iterations
                      ? BundleAdjustmentStatus::kConverged
                      : BundleAdjustmentStatus::kMaxIterations;
  return report;
}

}  // namespace

void BundleAdjustmentOptions::VisitFields(OptionVisitor& v) {
  v.Choice("loss", loss, kReprojectionLosses, "robust loss on the reprojection error");
  v.Double("loss_scale", loss_scale, {1e-6, 1e6},
           "error at which the loss leaves the square, in standard deviations of the observation");
  v.Int("max_iterations", max_iterations, {0, 100000}, "iterations of one adjustment");
  v.Double("function_tolerance", function_tolerance, {0, 1},
           "stop when the cost changes relatively by less");
  v.Choice("solver", solver, kBundleSolvers, "linear solver; auto: by the number of images");
  v.Int("max_dense_images", max_dense_images, {0, 1000000},
        "images up to which auto takes dense_schur");
  v.Int("max_sparse_images", max_sparse_images, {0, 1000000},
        "images up to which auto takes sparse_schur");
}

std::string_view BundleAdjustmentStatusName(BundleAdjustmentStatus status) {
  switch (status) {
    case BundleAdjustmentStatus::kConverged:
      return "converged";
    case BundleAdjustmentStatus::kMaxIterations:
      return "max_iterations";
    case BundleAdjustmentStatus::kNoObservations:
      return "no_observations";
    case BundleAdjustmentStatus::kFailed:
      return "failed";
    case BundleAdjustmentStatus::kStopped:
      return "stopped";
  }
  return "unknown";
}

BundleAdjustmentReport AdjustBundle(Reconstruction& reconstruction,
                                    const BundleAdjustmentScope& scope,
                                    const BundleAdjustmentOptions& options, const RunContext& run) {
  ValidateOptions(options, "bundle_adjustment");
  const Timer timer;
  const auto num_images = static_cast<int64_t>(reconstruction.images.size());
  const double covisibility = MeanCovisibility(reconstruction);
  const BundleSolver solver = ChooseSolver(options, scope, num_images, covisibility);
  const bool is_large = IsLargeBundle(options, num_images, covisibility) && SuitsLargeBundle(scope);
  BundleAdjustmentReport report = is_large
                                      ? AdjustByRows(options, scope, run, reconstruction)
                                      : AdjustByCeres(options, scope, solver, run, reconstruction);
  report.num_images = num_images;
  report.solver = solver;
  report.seconds = timer.Seconds();
  return report;
}

}  // namespace cairn
