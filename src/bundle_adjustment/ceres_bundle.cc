#include "bundle_adjustment/ceres_bundle.h"

#include <ceres/ceres.h>
#include <ceres/normal_prior.h>

#include <algorithm>
#include <memory>
#include <vector>

#include "bundle_adjustment/bundle_state.h"
#include "bundle_adjustment/bundle_terms.h"
#include "bundle_adjustment/reprojection_cost.h"
#include "cairn/base/parallel.h"

namespace cairn {
namespace {

// kAuto: a scope that does not suit SchurBundle.
ceres::LinearSolverType LinearSolver(const BundleAdjustmentOptions& options,
                                     const BundleAdjustmentScope& scope) {
  // Without points, or with nothing but points, there is nothing to eliminate.
  const bool has_others =
      scope.rotations || scope.positions || scope.focal_lengths || scope.distortions;
  if (!scope.points || !has_others) return ceres::SPARSE_NORMAL_CHOLESKY;
  if (options.solver == BundleSolver::kDenseSchur) return ceres::DENSE_SCHUR;
  return options.solver == BundleSolver::kIterativeSchur ? ceres::ITERATIVE_SCHUR
                                                         : ceres::SPARSE_SCHUR;
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
      AddPoint(point, state_.Point(index++));
    }
    for (const SurveyedPoint& point : scope.surveyed_points) {
      AddSurveyedPoint(point, state_.Point(index++));
    }
    for (const auto& [id, prior] : scope.priors) {
      const auto camera = reconstruction.cameras.find(id);
      if (camera == reconstruction.cameras.end()) continue;
      AddPrior(camera->second, prior, state_.Intrinsics(id));
    }
    for (const auto& [id, prior] : scope.image_positions) {
      if (!scope.positions || !reconstruction.images.contains(id)) continue;
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

  void AddPoint(const Point3D& point, Eigen::Vector3d& xyz) {
    int num_used = 0;
    for (const TrackElement& element : point.track) {
      const RegisteredImage& image = state_.reconstruction().images.at(element.image_id);
      const double sigma_px = image.sigmas_px.empty() ? 1.0 : image.sigmas_px[element.point2D];
      num_used += AddObservation(element.image_id, image.points2D[element.point2D], sigma_px,
                                 loss_.get(), xyz);
    }
    num_observations_ += num_used;
    num_points_ += num_used > 0;
  }

  // False: nothing of it is free, or the point is not in front of the camera.
  bool AddObservation(image_t id, const Eigen::Vector2d& pixel, double sigma_px,
                      ceres::LossFunction* loss, Eigen::Vector3d& xyz) {
    const BundleAdjustmentScope& scope = state_.scope();
    const Reconstruction& reconstruction = state_.reconstruction();
    const RegisteredImage& image = reconstruction.images.at(id);
    if (!reconstruction.CameraOf(image).ImgFromRay(image.cam_from_world * xyz)) return false;
    PoseState& pose = state_.Pose(id);
    IntrinsicsState& intrinsics = *pose.intrinsics;
    const bool pose_is_free = !scope.fixed_images.contains(id);
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

  void AddSurveyedPoint(const SurveyedPoint& point, Eigen::Vector3d& xyz) {
    for (const auto& [id, pixel] : point.pixels) {
      AddObservation(id, pixel, 1.0, &position_loss_, xyz);
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

ceres::Solver::Options SolverOptions(const BundleAdjustmentOptions& options,
                                     const BundleAdjustmentScope& scope, int num_threads) {
  ceres::Solver::Options ceres_options;
  ceres_options.linear_solver_type = LinearSolver(options, scope);
  ceres_options.preconditioner_type = ceres::SCHUR_JACOBI;
  ceres_options.max_num_iterations = options.max_iterations;
  ceres_options.gradient_tolerance = 1e-12;
  ceres_options.parameter_tolerance = 1e-10;
  ceres_options.max_num_consecutive_invalid_steps = 10;
  ceres_options.max_linear_solver_iterations = 200;
  // Ceres sums in the order in which threads come, and warns when asked for more than there are.
  ceres_options.num_threads =
      options.solver == BundleSolver::kAuto
          ? 1
          : std::min(EffectiveNumThreads(num_threads), EffectiveNumThreads(0));
  ceres_options.logging_type = ceres::SILENT;
  return ceres_options;
}

}  // namespace

BundleAdjustmentReport AdjustByCeres(const BundleAdjustmentOptions& options,
                                     const BundleAdjustmentScope& scope, const RunContext& run,
                                     Reconstruction& reconstruction) {
  BundleProblem problem(options, scope, reconstruction);
  BundleAdjustmentReport report;
  report.num_points = problem.num_points();
  report.num_observations = problem.num_observations();
  if (report.num_observations == 0) return report;
  ceres::Solver::Options solver_options = SolverOptions(options, scope, run.num_threads);
  const Tempo tempo = TempoOf(options, scope, report.num_observations);
  solver_options.initial_trust_region_radius = 1.0 / tempo.initial_damping;
  solver_options.max_trust_region_radius = 1.0 / kMinDamping;
  solver_options.function_tolerance = tempo.tolerance;
  StopCallback stop(run.monitor);
  solver_options.callbacks.push_back(&stop);
  const ceres::Solver::Summary summary = problem.Solve(solver_options);
  report.num_iterations =
      std::max(0, static_cast<int>(summary.iterations.size()) - 1);   // less the start
  SetRmse(2 * summary.initial_cost, 2 * summary.final_cost, report);  // Ceres halves them
  report.status = BundleAdjustmentStatus::kFailed;
  if (!summary.IsSolutionUsable()) return report;
  problem.state().Store(reconstruction);
  report.status = stop.stopped() ? BundleAdjustmentStatus::kStopped
                  : summary.termination_type == ceres::CONVERGENCE
                      ? BundleAdjustmentStatus::kConverged
                      : BundleAdjustmentStatus::kMaxIterations;
  return report;
}

}  // namespace cairn
