#include "bundle_adjustment/schur_bundle.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "bundle_adjustment/bundle_observations.h"
#include "bundle_adjustment/bundle_state.h"
#include "bundle_adjustment/bundle_terms.h"
#include "bundle_adjustment/camera_system.h"
#include "bundle_adjustment/intrinsics_prior.h"
#include "bundle_adjustment/reprojection_cost.h"
#include "bundle_adjustment/schur_kernels.h"
#include "cairn/base/parallel.h"
#include "math/levenberg_marquardt.h"

namespace cairn {
namespace {

constexpr int64_t kPointsPerTask = 1024;
constexpr int64_t kImagesPerTask = 4;

std::vector<int> CamerasOfImages(BundleState& bundle) {
  std::vector<int> cameras;
  for (const PoseState& pose : bundle.poses()) {
    cameras.push_back(static_cast<int>(pose.intrinsics - bundle.intrinsics().data()));
  }
  return cameras;
}

// The loss, and the weight by which it acts on squares (Triggs et al., "Bundle adjustment -
// a modern synthesis", 2000, without the second derivative, as Ceres where the loss flattens).
std::pair<double, double> RobustCost(const ceres::LossFunction* loss, double squared_error) {
  if (loss == nullptr) return {squared_error, 1.0};
  std::array<double, 3> rho{};
  loss->Evaluate(squared_error, rho.data());
  return {rho[0], rho[1]};
}

// A problem for Minimize (math/levenberg_marquardt.h). kIntrinsics: no camera has more that
// are free. What is not free has zeros in the Jacobian.
template <int kIntrinsics>
class SchurBundle {
 public:
  using System = CameraSystem<kIntrinsics>;
  static constexpr int kPose = System::kPose;
  static constexpr int kBlock = System::kBlock;
  using State = Eigen::VectorXd;  // CameraSystem's unknowns, then the points
  struct Model {
    double cost = 0;
    Eigen::VectorXd gradient;
    State state;
    int number = 0;  // of the linearization
  };

  SchurBundle(const BundleAdjustmentScope& scope, const Reconstruction& reconstruction,
              const ceres::LossFunction* loss, const RunContext& run, BundleState& bundle)
      : loss_(loss),
        run_(run),
        bundle_(bundle),
        observations_(CollectObservations(scope, reconstruction, run.num_threads)),
        system_(ImagesSeenTogether(observations_, run.num_threads), CamerasOfImages(bundle),
                static_cast<int>(bundle.intrinsics().size()), run.num_threads),
        linear_(std::make_unique_for_overwrite<Linear[]>(observations_.all.size())),
        inverse_(observations_.NumPoints()) {
    if (system_.IsFactorized()) {
      weights_.resize(observations_.all.size());
      bends_.resize(observations_.all.size());
    }
    for (const auto& [id, image] : reconstruction.images) {
      pose_is_free_.push_back(scope.fixed_images.count(id) == 0);
    }
    for (const auto& [id, camera] : reconstruction.cameras) {
      const auto prior = scope.priors.find(id);
      const IntrinsicsState& intrinsics = bundle.Intrinsics(id);
      if (prior == scope.priors.end() || intrinsics.num_free == 0) continue;
      const FreeIntrinsicsPrior of_free = PriorOfFree(camera, prior->second, intrinsics);
      const auto index = static_cast<int>(&intrinsics - bundle.intrinsics().data());
      priors_.push_back({system_.IntrinsicsAt(index), of_free.mean, of_free.precision, nullptr});
    }
    for (const auto& [id, prior] : scope.image_positions) {
      if (reconstruction.images.count(id) == 0 || scope.fixed_images.count(id) > 0) continue;
      const auto index = static_cast<int>(&bundle.Pose(id) - bundle.poses().data());
      priors_.push_back(
          {system_.PoseAt(index) + kPose - 3, prior.position, prior.precision, &position_loss_});
    }
    int p = observations_.num_unsurveyed;
    for (const SurveyedPoint& point : scope.surveyed_points) {
      priors_.push_back(
          {PointAt(p++), point.prior.position, point.prior.precision, &position_loss_});
    }
  }

  const BundleObservations& observations() const { return observations_; }

  State Start() {
    State x = State::Zero(system_.NumUnknowns() + 3 * static_cast<Eigen::Index>(inverse_.size()));
    ForEachBlock([&](Eigen::Index at, double* block, int size) {
      x.segment(at, size) = Eigen::Map<const Eigen::VectorXd>(block, size);
    });
    return x;
  }
  void SetState(const State& x) {
    ForEachBlock([&](Eigen::Index at, double* block, int size) {
      Eigen::Map<Eigen::VectorXd>(block, size) = x.segment(at, size);
    });
    bundle_.PrepareForEvaluation(true, true);
  }

  State Moved(const State& state, const Eigen::VectorXd& step) const { return state + step; }
  double Cost(const State& state) { return Evaluate(state, nullptr); }

  Model Linearize(const State& state) {
    Model model;
    model.state = state;
    model.cost = Evaluate(state, &model.gradient);
    model.number = number_ = ++last_number_;
    return model;
  }

  bool Solve(const Model& model, double damping, Eigen::VectorXd* step) {
    if (run_.monitor.StopRequested()) return false;
    if (model.number != number_) {  // what is there is of a step that was not taken
      Evaluate(model.state, step);
      number_ = model.number;
    }
    InvertPoints(damping);
    const Eigen::VectorXd right = FormSystem(model.gradient);
    Eigen::VectorXd cameras;
    if (!system_.Solve(DampedDiagonal(damping), right, &cameras)) return false;
    step->resize(model.gradient.size());
    step->head(cameras.size()) = cameras;
    FindPoints(model.gradient, *step);
    return step->allFinite();
  }

  // Adds half the acceleration to a step of Solve (see Minimize), where a factor makes it cheap.
  void Accelerate(const Model& model, Eigen::VectorXd* step) {
    if (!system_.IsFactorized()) return;
    SetState(model.state + kProbe * *step);
    Eigen::VectorXd slope(step->size());
    const Eigen::VectorXd right = FindBends(*step, slope);
    if (!right.allFinite()) return;
    Eigen::VectorXd acceleration(step->size());
    acceleration.head(right.size()) = system_.SolveByFactor(right);
    FindPoints(slope, acceleration);
    if (2 * LengthOf(acceleration) < kMaxAcceleration * LengthOf(*step)) {
      *step += 0.5 * acceleration;
    }
  }

 private:
  // How far along a step its residuals are looked at, and its longest acceleration (Transtrum and
  // Sethna's h and alpha).
  static constexpr double kProbe = 0.1, kMaxAcceleration = 0.75;

  // An observation's residual and its derivatives, weighed by the loss. They are rounded once, and
  // what is computed from them is exact for the rounded ones.
  struct Linear {
    Eigen::Matrix<float, 2, kBlock, Eigen::RowMajor> by_camera;
    Eigen::Matrix<float, 2, 3, Eigen::RowMajor> by_point;
    Eigen::Vector2f residual;
  };
  using ByCamera = Eigen::Matrix<double, 2, kBlock, Eigen::RowMajor>;
  using Image = Eigen::Matrix<double, kBlock, 1>;

  Eigen::Index PointAt(int64_t p) const { return system_.NumUnknowns() + 3 * p; }

  // Of each parameter block: where it stands in a vector of all, where in the state, and its size.
  void ForEachBlock(const std::function<void(Eigen::Index, double*, int)>& fn) {
    for (int i = 0; i < system_.NumImages(); ++i) {
      fn(system_.PoseAt(i), bundle_.poses()[i].block.data(), kPose);
    }
    for (int c = 0; c < static_cast<int>(bundle_.intrinsics().size()); ++c) {
      IntrinsicsState& intrinsics = bundle_.intrinsics()[c];
      fn(system_.IntrinsicsAt(c), intrinsics.free.data(), intrinsics.num_free);
    }
    for (int p = 0; p < observations_.NumPoints(); ++p)
      fn(PointAt(p), bundle_.points()[p].data(), 3);
  }

  // The cost, and with a gradient everything that Solve takes.
  double Evaluate(const State& state, Eigen::VectorXd* gradient) {
    SetState(state);
    if (gradient) gradient->setZero(state.size());
    const int64_t num_points = observations_.NumPoints();
    std::vector<double> costs((num_points + kPointsPerTask - 1) / kPointsPerTask);
    ParallelFor(run_.num_threads, static_cast<int64_t>(costs.size()), [&](int64_t task) {
      const int64_t end = std::min(num_points, (task + 1) * kPointsPerTask);
      double cost = 0;  // not in costs[task]: its cache line is the other threads', too
      for (int64_t p = task * kPointsPerTask; p < end; ++p) {
        for (int k = observations_.begin[p]; k < observations_.begin[p + 1]; ++k) {
          cost += EvaluateOne(k, gradient != nullptr);
          if (!gradient) continue;
          gradient->segment<3>(PointAt(p)) +=
              linear_[k].by_point.template cast<double>().transpose() *
              linear_[k].residual.template cast<double>();
        }
      }
      costs[task] = cost;
    });
    double cost = 0;
    for (const double part : costs) cost += part;
    if (gradient) SumUpCameras(*gradient);
    return cost + EvaluatePriors(state, gradient);
  }

  double EvaluatePriors(const State& state, Eigen::VectorXd* gradient) {
    double cost = 0;
    if (gradient) of_priors_.setZero(state.size());
    for (const Prior& prior : priors_) {
      const Eigen::Index n = prior.mean.size();
      const Eigen::VectorXd error =
          prior.precision.cwiseProduct(state.segment(prior.at, n) - prior.mean);
      const auto [of_prior, weight] = RobustCost(prior.loss, error.squaredNorm());
      cost += of_prior;
      if (!gradient) continue;
      gradient->segment(prior.at, n) += weight * prior.precision.cwiseProduct(error);
      of_priors_.segment(prior.at, n) = weight * prior.precision.cwiseAbs2();
    }
    return cost;
  }

  Reprojection ReprojectionOf(int k) const {
    const BundleObservation& observation = observations_.all[k];
    const bool is_free = pose_is_free_[observation.image];
    return {&bundle_.poses()[observation.image],
            &bundle_.points()[observations_.point_of[k]],
            observation.pixel,
            observation.precision,
            {.point = true, .rotation = is_free, .position = is_free}};
  }

  // Its cost; NaN where its camera does not see the point.
  double EvaluateOne(int k, bool with_derivatives) {
    const Reprojection reprojection = ReprojectionOf(k);
    const bool is_free = reprojection.free.rotation;
    Eigen::Vector2d residual;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
    Eigen::Matrix<double, 2, kPose, Eigen::RowMajor> by_pose;
    std::array<double, 2 * IntrinsicsState::kMaxParams> by_intrinsics;
    std::array<double*, 3> jacobians{by_point.data(), by_pose.data(), by_intrinsics.data()};
    if (!is_free) jacobians[1] = by_intrinsics.data();
    if (!reprojection.Evaluate(residual.data(), with_derivatives ? jacobians.data() : nullptr)) {
      return std::numeric_limits<double>::quiet_NaN();
    }
    const bool is_surveyed = k >= observations_.NumUnsurveyed();
    const auto [cost, squared_weight] =
        RobustCost(is_surveyed ? &position_loss_ : loss_, residual.squaredNorm());
    if (!with_derivatives) return cost;
    const double weight = std::sqrt(squared_weight);
    Linear& linear = linear_[k];
    linear.residual = (weight * residual).template cast<float>();
    linear.by_point = (weight * by_point).template cast<float>();
    linear.by_camera.setZero();
    if (is_free)
      linear.by_camera.template leftCols<kPose>() = (weight * by_pose).template cast<float>();
    if (!weights_.empty()) weights_[k] = static_cast<float>(weight);
    const int num_free = reprojection.pose->intrinsics->num_free;
    for (int row = 0; row < 2; ++row) {
      for (int column = 0; column < num_free; ++column) {
        linear.by_camera(row, kPose + column) =
            static_cast<float>(weight * by_intrinsics[row * num_free + column]);
      }
    }
    return cost;
  }

  // The second derivatives of the residuals along a step, from residuals a part of it ahead, where
  // the state is. Fills their products with the derivatives by points; returns the right-hand side
  // of the cameras' system.
  Eigen::VectorXd FindBends(const Eigen::VectorXd& step, Eigen::VectorXd& slope) {
    const auto images = system_.Spread(step);
    const auto by_point = [&](int64_t p) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (int k = observations_.begin[p]; k < observations_.begin[p + 1]; ++k) {
        const auto& J = linear_[k].by_point;
        const Eigen::Vector2d moved =
            linear_[k].by_camera.template cast<double>() * images.col(observations_.all[k].image) +
            J.template cast<double>() * step.segment<3>(PointAt(p));
        const Eigen::Vector2d bend = BendOf(k, moved);
        bends_[k] = bend.cast<float>();
        sum += J.template cast<double>().transpose() * bend;
      }
      slope.segment<3>(PointAt(p)) = sum;
    };
    ParallelFor(run_.num_threads, observations_.NumPoints(), by_point, kPointsPerTask);
    Eigen::Matrix<double, kBlock, Eigen::Dynamic> rights(kBlock, system_.NumImages());
    const auto by_image = [&](int64_t i) {
      Image right = Image::Zero();
      const std::vector<int>& observations = observations_.of_image[i];
      for (size_t n = 0; n < observations.size(); ++n) {
        if (n + kNear < observations.size()) PrefetchLinear(observations[n + kNear]);
        const int k = observations[n], p = observations_.point_of[k];
        const Eigen::Vector2d of_point = linear_[k].by_point.template cast<double>() *
                                         (inverse_[p] * slope.segment<3>(PointAt(p)));
        right += linear_[k].by_camera.template cast<double>().transpose() *
                 (of_point - bends_[k].template cast<double>());
      }
      rights.col(i) = right;
    };
    ParallelFor(run_.num_threads, system_.NumImages(), by_image, kImagesPerTask);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(system_.NumUnknowns());
    system_.Gather(rights, right);
    return right;
  }

  // moved: what the derivatives say of the whole step. NaN where the camera does not see the point.
  Eigen::Vector2d BendOf(int k, const Eigen::Vector2d& moved) const {
    Eigen::Vector2d ahead;
    if (!ReprojectionOf(k).Evaluate(ahead.data(), nullptr)) {
      return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
    }
    const Eigen::Vector2d change =
        weights_[k] * ahead - linear_[k].residual.template cast<double>();
    return 2 / kProbe * (change / kProbe - moved);
  }

  // Of what the cameras have of a step, each unknown in the unit of its own curvature.
  double LengthOf(const Eigen::VectorXd& step) const {
    return std::sqrt(curvature_.dot(step.head(curvature_.size()).cwiseAbs2()));
  }

  // Gradient and diagonal of the normal equations, of poses and intrinsics.
  void SumUpCameras(Eigen::VectorXd& gradient) {
    Eigen::Matrix<double, kBlock, Eigen::Dynamic> slopes(kBlock, system_.NumImages());
    Eigen::Matrix<double, kBlock, Eigen::Dynamic> curvatures(kBlock, system_.NumImages());
    const auto sum_up = [&](int64_t i) {
      Image slope = Image::Zero(), curvature = Image::Zero();
      const std::vector<int>& observations = observations_.of_image[i];
      for (size_t n = 0; n < observations.size(); ++n) {
        if (n + kNear < observations.size()) PrefetchLinear(observations[n + kNear]);
        const int k = observations[n];
        const auto J = linear_[k].by_camera.template cast<double>();
        slope += J.transpose() * linear_[k].residual.template cast<double>();
        curvature += J.colwise().squaredNorm().transpose();
      }
      slopes.col(i) = slope;
      curvatures.col(i) = curvature;
    };
    ParallelFor(run_.num_threads, system_.NumImages(), sum_up, kImagesPerTask);
    curvature_.setZero(system_.NumUnknowns());
    system_.Gather(slopes, gradient);
    system_.Gather(curvatures, curvature_);
  }

  // What is added to the diagonal. Without curvature an unknown stays.
  Eigen::VectorXd DampedDiagonal(double damping) const {
    const Eigen::ArrayXd of_priors = of_priors_.head(system_.NumUnknowns());
    const Eigen::ArrayXd curvature = curvature_.array() + of_priors;
    return (curvature > 0).select(damping * curvature + of_priors, 1.0);
  }

  void InvertPoints(double damping) {
    const auto invert = [&](int64_t p) {
      Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
      for (int k = observations_.begin[p]; k < observations_.begin[p + 1]; ++k) {
        const Eigen::Matrix<double, 2, 3> J = linear_[k].by_point.template cast<double>();
        H += J.transpose() * J;
      }
      H.diagonal() += of_priors_.segment<3>(PointAt(p));
      for (int i = 0; i < 3; ++i) H(i, i) += H(i, i) > 0 ? damping * H(i, i) : 1.0;
      inverse_[p] = H.inverse();
    };
    ParallelFor(run_.num_threads, observations_.NumPoints(), invert, kPointsPerTask);
  }

  // The cameras' system, and its right-hand side.
  Eigen::VectorXd FormSystem(const Eigen::VectorXd& gradient) {
    Eigen::Matrix<double, kBlock, Eigen::Dynamic> rights(kBlock, system_.NumImages());
    std::vector<std::vector<int64_t>> block_of(EffectiveNumThreads(run_.num_threads));
    const auto form = [&](int worker, int64_t i) {
      block_of[worker].resize(system_.NumImages());
      rights.col(i) = FormRow(static_cast<int>(i), gradient, block_of[worker]);
    };
    ParallelForWorker(run_.num_threads, system_.NumImages(), form, kImagesPerTask);
    Eigen::VectorXd right = -gradient.head(system_.NumUnknowns());
    system_.Gather(rights, right);
    return right;
  }

  // Fills an image's row; what the points add to its right-hand side. block_of: scratch, of images.
  Image FormRow(int i, const Eigen::VectorXd& gradient, std::vector<int64_t>& block_of) {
    for (int64_t k = system_.RowBegin(i); k < system_.RowEnd(i); ++k) {
      block_of[system_.Column(k)] = k;
      system_.BlockAt(k).setZero();
    }
    Image right = Image::Zero();
    std::vector<internal::SchurPartner> partners;  // of one observation, itself among them
    const std::vector<int>& observations = observations_.of_image[i];
    for (size_t n = 0; n < observations.size(); ++n) {
      Prefetch(observations, n);
      const int a = observations[n], p = observations_.point_of[a];
      const ByCamera J = linear_[a].by_camera.template cast<double>();
      const Eigen::Matrix<double, 2, 3> Q =
          linear_[a].by_point.template cast<double>() * inverse_[p];
      right += J.transpose() * (Q * gradient.segment<3>(PointAt(p)));
      int b = a;
      while (b > observations_.begin[p] && observations_.all[b - 1].image == i) --b;
      partners.clear();
      for (; b < observations_.begin[p + 1]; ++b) {
        Eigen::Matrix2d M = Q * linear_[b].by_point.transpose().template cast<double>();
        if (b == a) M -= Eigen::Matrix2d::Identity();
        partners.push_back({{M(0, 0), M(0, 1), M(1, 0), M(1, 1)},
                            linear_[b].by_camera.data(),
                            system_.BlockAt(block_of[observations_.all[b].image]).data()});
      }
      internal::SubtractFromBlocks<kBlock>(J.data(), partners.data(),
                                           static_cast<int>(partners.size()));
    }
    return right;
  }

  // An image's points are far apart: how many observations ahead memory is told to load them.
  static constexpr size_t kNear = 4, kFar = 12;
  static constexpr int kUsualLength = 6;  // of a track

  // What FormRow will read.
  void Prefetch(const std::vector<int>& observations, size_t n) const {
    if (n + kFar >= observations.size()) return;
    const int far = observations[n + kFar], near = observations[n + kNear];
    __builtin_prefetch(&observations_.point_of[far]);
    __builtin_prefetch(&observations_.all[far]);
    const int p = observations_.point_of[near];
    __builtin_prefetch(&inverse_[p]);
    __builtin_prefetch(&observations_.begin[p]);
    const int end = std::min(near + kUsualLength, observations_.begin.back());
    for (int b = near; b < end; ++b) PrefetchLinear(b);
  }
  void PrefetchLinear(int k) const {
    __builtin_prefetch(linear_[k].by_camera.data());
    __builtin_prefetch(linear_[k].residual.data());
  }

  // The points' part of a step, from that of the cameras.
  void FindPoints(const Eigen::VectorXd& gradient, Eigen::VectorXd& step) const {
    const auto images = system_.Spread(step);
    const auto find = [&](int64_t p) {
      Eigen::Vector3d right = gradient.segment<3>(PointAt(p));
      for (int k = observations_.begin[p]; k < observations_.begin[p + 1]; ++k) {
        const Eigen::Vector2d moved =
            linear_[k].by_camera.template cast<double>() * images.col(observations_.all[k].image);
        right += linear_[k].by_point.transpose().template cast<double>() * moved;
      }
      step.segment<3>(PointAt(p)) = -inverse_[p] * right;
    };
    ParallelFor(run_.num_threads, observations_.NumPoints(), find, kPointsPerTask);
  }

  const ceres::LossFunction* loss_;
  const RunContext& run_;
  BundleState& bundle_;
  BundleObservations observations_;
  System system_;
  // Of the observations. Not set to zero: the threads that fill it are the first to touch it.
  std::unique_ptr<Linear[]> linear_;
  std::vector<float> weights_;            // of the observations' residuals, for Accelerate
  std::vector<Eigen::Vector2f> bends_;    // as FindBends found them
  std::vector<Eigen::Matrix3d> inverse_;  // of the points' blocks
  Eigen::VectorXd curvature_;             // of the unknowns of cameras, by the observations
  std::vector<char> pose_is_free_;
  ceres::HuberLoss position_loss_{kPositionLossScale};
  struct Prior {
    Eigen::Index at;  // of the first of its unknowns
    Eigen::VectorXd mean, precision;
    const ceres::LossFunction* loss;
  };
  std::vector<Prior> priors_;
  Eigen::VectorXd of_priors_;  // what they add to the normal equations' diagonal
  int number_ = 0;             // of the linearization in linear_
  int last_number_ = 0;
};

template <int kIntrinsics>
BundleAdjustmentReport Adjust(const BundleAdjustmentOptions& options,
                              const BundleAdjustmentScope& scope, const RunContext& run,
                              Reconstruction& reconstruction, BundleState& state) {
  const std::unique_ptr<ceres::LossFunction> loss = MakeLoss(options);
  SchurBundle<kIntrinsics> problem(scope, reconstruction, loss.get(), run, state);
  const BundleObservations& observations = problem.observations();
  BundleAdjustmentReport report;
  report.num_observations = observations.NumUnsurveyed();
  for (int p = 0; p < observations.num_unsurveyed; ++p) {
    report.num_points += observations.begin[p] < observations.begin[p + 1];
  }
  if (report.num_observations == 0) return report;
  const Tempo tempo = TempoOf(options, scope, report.num_observations);
  Eigen::VectorXd x = problem.Start();
  const double initial_cost = problem.Cost(x);
  const LevenbergMarquardtReport solution = Minimize(problem,
                                                     {.max_iterations = options.max_iterations,
                                                      .min_relative_gain = tempo.tolerance,
                                                      .initial_damping = tempo.initial_damping,
                                                      .damping_rule = DampingRule::kGainRatio},
                                                     &x);
  report.num_iterations = solution.num_iterations;
  SetRmse(initial_cost, solution.cost, report);
  report.status = BundleAdjustmentStatus::kFailed;
  if (!std::isfinite(solution.cost)) return report;
  problem.SetState(x);
  state.Store(scope, reconstruction);
  report.status = run.monitor.StopRequested() ? BundleAdjustmentStatus::kStopped
                  : report.num_iterations < options.max_iterations
                      ? BundleAdjustmentStatus::kConverged
                      : BundleAdjustmentStatus::kMaxIterations;
  return report;
}

}  // namespace

bool SuitsSchurBundle(const BundleAdjustmentScope& scope) {
  return scope.points && scope.positions && scope.rotations;
}

BundleAdjustmentReport AdjustBySchurBundle(const BundleAdjustmentOptions& options,
                                           const BundleAdjustmentScope& scope,
                                           const RunContext& run, Reconstruction& reconstruction) {
  BundleState state(scope, reconstruction);
  int num_free = 0;
  for (const IntrinsicsState& intrinsics : state.intrinsics()) {
    num_free = std::max(num_free, intrinsics.num_free);
  }
  return num_free <= 4 ? Adjust<4>(options, scope, run, reconstruction, state)
                       : Adjust<kMaxCameraParams>(options, scope, run, reconstruction, state);
}

}  // namespace cairn
