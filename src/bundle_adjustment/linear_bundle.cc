#include "bundle_adjustment/linear_bundle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "cairn/base/parallel.h"

namespace cairn {
namespace {

// How far along a step its residuals are looked at (Transtrum and Sethna's h).
constexpr double kProbe = 0.1;

// The loss, and the weight by which it acts on squares (Triggs et al., "Bundle adjustment -
// a modern synthesis", 2000, without the second derivative, as Ceres where the loss flattens).
std::pair<double, double> RobustCost(const ceres::LossFunction* loss, double squared_error) {
  if (loss == nullptr) return {squared_error, 1.0};
  std::array<double, 3> rho{};
  loss->Evaluate(squared_error, rho.data());
  return {rho[0], rho[1]};
}

}  // namespace

template <int kIntrinsics>
LinearBundle<kIntrinsics>::LinearBundle(const ceres::LossFunction* loss, const RunContext& run,
                                        BundleState& bundle, const BundleObservations& observations,
                                        const System& system)
    : loss_(loss),
      run_(run),
      bundle_(bundle),
      observations_(observations),
      system_(system),
      linear_(std::make_unique_for_overwrite<Linear[]>(observations.all.size())) {
  if (system_.IsFactorized()) {
    weights_.resize(observations_.all.size());
    bends_.resize(observations_.all.size());
  }
  for (const auto& [id, image] : bundle.reconstruction().images) {
    pose_is_free_.push_back(!bundle.scope().fixed_images.contains(id));
  }
  AddPriors();
}

template <int kIntrinsics>
void LinearBundle<kIntrinsics>::AddPriors() {
  const BundleAdjustmentScope& scope = bundle_.scope();
  const Reconstruction& reconstruction = bundle_.reconstruction();
  for (const auto& [id, camera] : reconstruction.cameras) {
    const auto prior = scope.priors.find(id);
    const IntrinsicsState& intrinsics = bundle_.Intrinsics(id);
    if (prior == scope.priors.end() || intrinsics.num_free == 0) continue;
    const FreeIntrinsicsPrior of_free = PriorOfFree(camera, prior->second, intrinsics);
    const auto index = static_cast<int>(&intrinsics - bundle_.intrinsics().data());
    priors_.push_back({system_.IntrinsicsAt(index), of_free.mean, of_free.precision, nullptr});
  }
  for (const auto& [id, prior] : scope.image_positions) {
    if (!reconstruction.images.contains(id) || scope.fixed_images.contains(id)) continue;
    const auto index = static_cast<int>(&bundle_.Pose(id) - bundle_.poses().data());
    priors_.push_back(
        {system_.PoseAt(index) + kPose - 3, prior.position, prior.precision, &position_loss_});
  }
  int p = observations_.num_unsurveyed;
  for (const SurveyedPoint& point : scope.surveyed_points) {
    priors_.push_back({PointAt(p++), point.prior.position, point.prior.precision, &position_loss_});
  }
}

template <int kIntrinsics>
Eigen::VectorXd LinearBundle<kIntrinsics>::State() {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(PointAt(observations_.NumPoints()));
  ForEachBlock([&](Eigen::Index at, double* block, int size) {
    x.segment(at, size) = Eigen::Map<const Eigen::VectorXd>(block, size);
  });
  return x;
}

template <int kIntrinsics>
void LinearBundle<kIntrinsics>::SetState(const Eigen::VectorXd& x) {
  ForEachBlock([&](Eigen::Index at, double* block, int size) {
    Eigen::Map<Eigen::VectorXd>(block, size) = x.segment(at, size);
  });
  bundle_.PrepareForEvaluation(true, true);
}

template <int kIntrinsics>
void LinearBundle<kIntrinsics>::ForEachBlock(
    const std::function<void(Eigen::Index, double*, int)>& fn) {
  for (int i = 0; i < system_.NumImages(); ++i) {
    fn(system_.PoseAt(i), bundle_.poses()[i].block.data(), kPose);
  }
  for (int c = 0; c < static_cast<int>(bundle_.intrinsics().size()); ++c) {
    IntrinsicsState& intrinsics = bundle_.intrinsics()[c];
    fn(system_.IntrinsicsAt(c), intrinsics.free.data(), intrinsics.num_free);
  }
  for (int p = 0; p < observations_.NumPoints(); ++p) fn(PointAt(p), bundle_.points()[p].data(), 3);
}

template <int kIntrinsics>
double LinearBundle<kIntrinsics>::Evaluate(const Eigen::VectorXd& state,
                                           Eigen::VectorXd* gradient) {
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

template <int kIntrinsics>
double LinearBundle<kIntrinsics>::EvaluatePriors(const Eigen::VectorXd& state,
                                                 Eigen::VectorXd* gradient) {
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

template <int kIntrinsics>
Reprojection LinearBundle<kIntrinsics>::ReprojectionOf(int k) const {
  const BundleObservation& observation = observations_.all[k];
  const bool is_free = pose_is_free_[observation.image];
  return {&bundle_.poses()[observation.image],
          &bundle_.points()[observations_.point_of[k]],
          observation.pixel,
          observation.precision,
          {.point = true, .rotation = is_free, .position = is_free}};
}

// Its cost; NaN where its camera does not see the point.
template <int kIntrinsics>
double LinearBundle<kIntrinsics>::EvaluateOne(int k, bool with_derivatives) {
  const Reprojection reprojection = ReprojectionOf(k);
  const bool is_free = reprojection.free.rotation;
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 3, Eigen::RowMajor> by_point;
  Eigen::Matrix<double, 2, kPose, Eigen::RowMajor> by_pose;
  std::array<double, 2 * kMaxCameraParams> by_intrinsics;
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

// Gradient and diagonal of the normal equations, of poses and intrinsics.
template <int kIntrinsics>
void LinearBundle<kIntrinsics>::SumUpCameras(Eigen::VectorXd& gradient) {
  Eigen::Matrix<double, kBlock, Eigen::Dynamic> slopes(kBlock, system_.NumImages());
  Eigen::Matrix<double, kBlock, Eigen::Dynamic> curvatures(kBlock, system_.NumImages());
  const auto sum_up = [&](int64_t i) {
    Image slope = Image::Zero(), curvature = Image::Zero();
    const std::vector<int>& observations = observations_.of_image[i];
    for (size_t n = 0; n < observations.size(); ++n) {
      if (n + kNear < observations.size()) Prefetch(observations[n + kNear]);
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

template <int kIntrinsics>
const std::vector<Eigen::Vector2f>& LinearBundle<kIntrinsics>::FindBends(
    const Eigen::VectorXd& state, const Eigen::VectorXd& step) {
  SetState(state + kProbe * step);
  const auto images = system_.Spread(step);
  const auto find = [&](int64_t p) {
    for (int k = observations_.begin[p]; k < observations_.begin[p + 1]; ++k) {
      Eigen::Vector2d ahead;
      if (!ReprojectionOf(k).Evaluate(ahead.data(), nullptr)) {
        ahead.setConstant(std::numeric_limits<double>::quiet_NaN());
      }
      const Eigen::Vector2d change =
          weights_[k] * ahead - linear_[k].residual.template cast<double>();
      const Eigen::Vector2d moved =
          linear_[k].by_camera.template cast<double>() * images.col(observations_.all[k].image) +
          linear_[k].by_point.template cast<double>() * step.segment<3>(PointAt(p));
      bends_[k] = (2 / kProbe * (change / kProbe - moved)).template cast<float>();
    }
  };
  ParallelFor(run_.num_threads, observations_.NumPoints(), find, kPointsPerTask);
  return bends_;
}

template class LinearBundle<4>;
template class LinearBundle<8>;
template class LinearBundle<kMaxCameraParams>;

}  // namespace cairn
