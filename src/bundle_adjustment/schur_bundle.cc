#include "bundle_adjustment/schur_bundle.h"

#include <Eigen/LU>
#include <cmath>
#include <memory>
#include <vector>

#include "bundle_adjustment/bundle_observations.h"
#include "bundle_adjustment/bundle_state.h"
#include "bundle_adjustment/bundle_terms.h"
#include "bundle_adjustment/linear_bundle.h"
#include "bundle_adjustment/schur_kernels.h"
#include "bundle_adjustment/schur_product.h"
#include "cairn/base/parallel.h"
#include "math/levenberg_marquardt.h"

namespace cairn {
namespace {

std::vector<int> CamerasOfImages(BundleState& bundle) {
  std::vector<int> cameras;
  for (const PoseState& pose : bundle.poses()) {
    cameras.push_back(static_cast<int>(pose.intrinsics - bundle.intrinsics().data()));
  }
  return cameras;
}

// Images that see an observation's point, on average.
double MeanCovisibility(const BundleObservations& observations) {
  double pairs = 0;
  for (int p = 0; p < observations.NumPoints(); ++p) {
    pairs += std::pow(observations.begin[p + 1] - observations.begin[p], 2);
  }
  return pairs / std::max<double>(1, observations.begin.back());
}

// A problem for Minimize (math/levenberg_marquardt.h): the points are eliminated from the normal
// equations of a LinearBundle. kIntrinsics: no camera has more that are free.
template <int kIntrinsics>
class SchurBundle {
 public:
  using Bundle = LinearBundle<kIntrinsics>;
  using System = CameraSystem<kIntrinsics>;
  static constexpr int kBlock = System::kBlock;
  using State = Eigen::VectorXd;
  struct Model {
    double cost = 0;
    Eigen::VectorXd gradient;
    State state;
    int number = 0;  // of the linearization
  };

  SchurBundle(const ceres::LossFunction* loss, const RunContext& run, BundleState& bundle)
      : run_(run),
        observations_(
            CollectObservations(bundle.scope(), bundle.reconstruction(), run.num_threads)),
        system_(MakeSystem(observations_, bundle, run.num_threads)),
        linear_(loss, run, bundle, observations_, system_),
        inverse_(observations_.NumPoints()),
        by_points_(observations_, system_, linear_, inverse_, run.num_threads) {}

  const BundleObservations& observations() const { return observations_; }
  State Start() { return linear_.State(); }
  void SetState(const State& x) { linear_.SetState(x); }

  State Moved(const State& state, const Eigen::VectorXd& step) const { return state + step; }
  double Cost(const State& state) { return linear_.Evaluate(state, nullptr); }

  Model Linearize(const State& state) {
    Model model;
    model.state = state;
    model.cost = linear_.Evaluate(state, &model.gradient);
    model.number = number_ = ++last_number_;
    return model;
  }

  bool Solve(const Model& model, double damping, Eigen::VectorXd* step) {
    if (run_.monitor.StopRequested()) return false;
    if (model.number != number_) {  // what is there is of a step that was not taken
      linear_.Evaluate(model.state, step);
      number_ = model.number;
    }
    InvertPoints(damping);
    const Eigen::VectorXd right = FormSystem(model.gradient);
    const Eigen::VectorXd diagonal = DampedDiagonal(damping);
    step->resize(model.gradient.size());
    if (!system_.IsFactorized()) {
      step->head(right.size()) =
          system_.SolveByProducts([&](const auto& x) { return Multiply(x); },
                                  by_points_.IntrinsicsBlocks(), diagonal, right);
    } else if (system_.Factorize(diagonal)) {
      step->head(right.size()) = system_.SolveByFactor(right);
    } else {
      return false;
    }
    FindPoints(model.gradient, *step);
    return step->allFinite();
  }

  // Adds half the acceleration to a step of Solve (see Minimize), where a factor makes it cheap.
  void Accelerate(const Model& model, Eigen::VectorXd* step) {
    if (!system_.IsFactorized()) return;
    const std::vector<Eigen::Vector2f>& bends = linear_.FindBends(model.state, *step);
    const Eigen::VectorXd slope = SlopesOfPoints(bends);
    const Eigen::VectorXd right = RightOfBends(bends, slope);
    if (!right.allFinite()) return;
    Eigen::VectorXd acceleration(step->size());
    acceleration.head(right.size()) = system_.SolveByFactor(right);
    FindPoints(slope, acceleration);
    if (2 * LengthOf(acceleration) < kMaxAcceleration * LengthOf(*step)) {
      *step += 0.5 * acceleration;
    }
  }

 private:
  // The longest acceleration beside its step (Transtrum and Sethna's alpha).
  static constexpr double kMaxAcceleration = 0.75;
  using ByCamera = Eigen::Matrix<double, 2, kBlock, Eigen::RowMajor>;
  using Image = typename Bundle::Image;
  using Images = typename System::Images;

  // The solution of the fewest operations.
  static System MakeSystem(const BundleObservations& observations, BundleState& bundle,
                           int num_threads) {
    const auto make = [&](const std::vector<std::vector<int>>& columns, double max_factor_flops) {
      return System(columns, CamerasOfImages(bundle), static_cast<int>(bundle.intrinsics().size()),
                    num_threads, max_factor_flops);
    };
    const SchurFlops flops(kBlock, observations.begin.back(), MeanCovisibility(observations));
    if (flops.form < flops.by_points) {
      const auto columns = ImagesSeenTogether(observations, num_threads);
      int64_t num_pairs = 0;
      for (const std::vector<int>& row : columns) num_pairs += std::ssize(row);
      System formed = make(columns, flops.MostOfFactor(num_pairs));
      if (formed.IsFactorized() || flops.FormsWithoutFactor(num_pairs)) return formed;
    }
    std::vector<std::vector<int>> alone;
    for (int i = 0; i < std::ssize(bundle.poses()); ++i) alone.push_back({i});
    return make(alone, 0);
  }

  Eigen::VectorXd Multiply(const Eigen::VectorXd& x) const {
    return system_.IsFormed() ? system_.Multiply(x) : by_points_.Multiply(x);
  }

  Eigen::Index PointAt(int64_t p) const { return linear_.PointAt(p); }

  // What is added to the diagonal. Without curvature an unknown stays.
  Eigen::VectorXd DampedDiagonal(double damping) const {
    const Eigen::ArrayXd of_priors = linear_.of_priors().head(system_.NumUnknowns());
    const Eigen::ArrayXd curvature = linear_.curvature().array() + of_priors;
    return (curvature > 0).select(damping * curvature + of_priors, 1.0);
  }

  void InvertPoints(double damping) {
    const auto invert = [&](int64_t p) {
      Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
      for (int k = observations_.begin[p]; k < observations_.begin[p + 1]; ++k) {
        const Eigen::Matrix<double, 2, 3> J = linear_[k].by_point.template cast<double>();
        H += J.transpose() * J;
      }
      H.diagonal() += linear_.of_priors().template segment<3>(PointAt(p));
      for (int i = 0; i < 3; ++i) H(i, i) += H(i, i) > 0 ? damping * H(i, i) : 1.0;
      inverse_[p] = H.inverse();
    };
    ParallelFor(run_.num_threads, observations_.NumPoints(), invert, Bundle::kPointsPerTask);
  }

  // The cameras' system, and its right-hand side.
  Eigen::VectorXd FormSystem(const Eigen::VectorXd& gradient) {
    Images rights(kBlock, system_.NumImages());
    std::vector<std::vector<int64_t>> block_of(EffectiveNumThreads(run_.num_threads));
    const auto form = [&](int worker, int64_t i) {
      block_of[worker].resize(system_.NumImages());
      rights.col(i) = FormRow(static_cast<int>(i), gradient, block_of[worker]);
    };
    ParallelForWorker(run_.num_threads, system_.NumImages(), form, Bundle::kImagesPerTask);
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
        if (!system_.IsFormed() && observations_.all[b].image != i) break;
        Eigen::Matrix2d M = Q * linear_[b].by_point.transpose().template cast<double>();
        if (b == a) M -= Eigen::Matrix2d::Identity();
        partners.push_back({{M(0, 0), M(0, 1), M(1, 0), M(1, 1)},
                            linear_[b].by_camera.data(),
                            system_.BlockAt(block_of[observations_.all[b].image]).data()});
      }
      internal::SubtractFromBlocks(kBlock, J.data(), partners.data(),
                                   static_cast<int>(partners.size()));
    }
    return right;
  }

  static constexpr size_t kNear = Bundle::kNear, kFar = 12;
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
    for (int b = near; b < end; ++b) linear_.Prefetch(b);
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
    ParallelFor(run_.num_threads, observations_.NumPoints(), find, Bundle::kPointsPerTask);
  }

  // The bends' products with the derivatives by points, where the points stand in a step.
  Eigen::VectorXd SlopesOfPoints(const std::vector<Eigen::Vector2f>& bends) const {
    Eigen::VectorXd slope(PointAt(observations_.NumPoints()));
    const auto sum_up = [&](int64_t p) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (int k = observations_.begin[p]; k < observations_.begin[p + 1]; ++k) {
        sum += linear_[k].by_point.template cast<double>().transpose() *
               bends[k].template cast<double>();
      }
      slope.segment<3>(PointAt(p)) = sum;
    };
    ParallelFor(run_.num_threads, observations_.NumPoints(), sum_up, Bundle::kPointsPerTask);
    return slope;
  }

  // The right-hand side of the cameras' system for the acceleration.
  Eigen::VectorXd RightOfBends(const std::vector<Eigen::Vector2f>& bends,
                               const Eigen::VectorXd& slope) const {
    Images rights(kBlock, system_.NumImages());
    const auto sum_up = [&](int64_t i) {
      Image right = Image::Zero();
      const std::vector<int>& observations = observations_.of_image[i];
      for (size_t n = 0; n < observations.size(); ++n) {
        if (n + kNear < observations.size()) linear_.Prefetch(observations[n + kNear]);
        const int k = observations[n], p = observations_.point_of[k];
        const Eigen::Vector2d of_point = linear_[k].by_point.template cast<double>() *
                                         (inverse_[p] * slope.segment<3>(PointAt(p)));
        right += linear_[k].by_camera.template cast<double>().transpose() *
                 (of_point - bends[k].template cast<double>());
      }
      rights.col(i) = right;
    };
    ParallelFor(run_.num_threads, system_.NumImages(), sum_up, Bundle::kImagesPerTask);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(system_.NumUnknowns());
    system_.Gather(rights, right);
    return right;
  }

  // Of what the cameras have of a step, each unknown in the unit of its own curvature.
  double LengthOf(const Eigen::VectorXd& step) const {
    const Eigen::VectorXd& curvature = linear_.curvature();
    return std::sqrt(curvature.dot(step.head(curvature.size()).cwiseAbs2()));
  }

  const RunContext& run_;
  const BundleObservations observations_;
  System system_;
  Bundle linear_;
  std::vector<Eigen::Matrix3d> inverse_;  // of the points' blocks
  const SchurProduct<kIntrinsics> by_points_;
  int number_ = 0;  // of the linearization in linear_
  int last_number_ = 0;
};

template <int kIntrinsics>
BundleAdjustmentReport Adjust(const BundleAdjustmentOptions& options,
                              const BundleAdjustmentScope& scope, const RunContext& run,
                              Reconstruction& reconstruction, BundleState& state) {
  const std::unique_ptr<ceres::LossFunction> loss = MakeLoss(options);
  SchurBundle<kIntrinsics> problem(loss.get(), run, state);
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
  state.Store(reconstruction);
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
  switch (IntrinsicsOfBlock(num_free)) {
    case 4:
      return Adjust<4>(options, scope, run, reconstruction, state);
    case 8:
      return Adjust<8>(options, scope, run, reconstruction, state);
    default:
      return Adjust<kMaxCameraParams>(options, scope, run, reconstruction, state);
  }
}

}  // namespace cairn
