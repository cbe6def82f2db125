#pragma once

#include <ceres/loss_function.h>

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "bundle_adjustment/bundle_observations.h"
#include "bundle_adjustment/bundle_state.h"
#include "bundle_adjustment/bundle_terms.h"
#include "bundle_adjustment/camera_system.h"
#include "bundle_adjustment/reprojection_cost.h"
#include "cairn/base/run_context.h"

namespace cairn {

// What bundle adjustment minimizes, at a state and linear about it: the errors of all observations
// and priors, and their derivatives. A state, a gradient or a step is a vector of CameraSystem's
// unknowns, then of the points. What is not free has zeros in the Jacobian. Equal for any number of
// threads.
template <int kIntrinsics>
class LinearBundle {
 public:
  using System = CameraSystem<kIntrinsics>;
  static constexpr int kPose = System::kPose;
  static constexpr int kBlock = System::kBlock;
  using Image = Eigen::Matrix<double, kBlock, 1>;
  // An observation's residual and its derivatives, weighed by the loss. They are rounded once, and
  // what is computed from them is exact for the rounded ones.
  struct Linear {
    Eigen::Matrix<float, 2, kBlock, Eigen::RowMajor> by_camera;
    Eigen::Matrix<float, 2, 3, Eigen::RowMajor> by_point;
    Eigen::Vector2f residual;
  };

  static constexpr int64_t kPointsPerTask = 1024;
  static constexpr int64_t kImagesPerTask = 4;
  // An image's points are far apart: how many observations ahead memory is told to load them.
  static constexpr size_t kNear = 4;

  LinearBundle(const ceres::LossFunction* loss, const RunContext& run, BundleState& bundle,
               const BundleObservations& observations, const System& system);

  Eigen::Index PointAt(int64_t p) const { return system_.NumUnknowns() + 3 * p; }
  Eigen::VectorXd State();
  void SetState(const Eigen::VectorXd& x);

  // Goes to a state; its cost, NaN where a camera does not see one of its points. With a gradient
  // (half the cost's), everything that follows is of this state.
  double Evaluate(const Eigen::VectorXd& state, Eigen::VectorXd* gradient);

  const Linear& operator[](int k) const { return linear_[k]; }
  void Prefetch(int k) const {
    __builtin_prefetch(linear_[k].by_camera.data());
    __builtin_prefetch(linear_[k].residual.data());
  }
  // The diagonal of the normal equations: of the observations, of cameras' unknowns alone; of the
  // priors.
  const Eigen::VectorXd& curvature() const { return curvature_; }
  const Eigen::VectorXd& of_priors() const { return of_priors_; }

  // The second derivatives of the weighed residuals along a step, by the residuals at a part of it
  // ahead, where this leaves the state; not a number where a camera does not see a point there.
  // Only where the system is factorized, which alone has a use for them.
  const std::vector<Eigen::Vector2f>& FindBends(const Eigen::VectorXd& state,
                                                const Eigen::VectorXd& step);

 private:
  struct Prior {
    Eigen::Index at;  // of the first of its unknowns
    Eigen::VectorXd mean, precision;
    const ceres::LossFunction* loss;
  };

  void AddPriors();
  // Of each parameter block: where it stands in a vector of all, where in the state, and its size.
  void ForEachBlock(const std::function<void(Eigen::Index, double*, int)>& fn);
  Reprojection ReprojectionOf(int k) const;
  double EvaluateOne(int k, bool with_derivatives);
  double EvaluatePriors(const Eigen::VectorXd& state, Eigen::VectorXd* gradient);
  void SumUpCameras(Eigen::VectorXd& gradient);

  const ceres::LossFunction* loss_;
  const RunContext& run_;
  BundleState& bundle_;
  const BundleObservations& observations_;
  const System& system_;
  // Of the observations. Not set to zero: the threads that fill it are the first to touch it.
  std::unique_ptr<Linear[]> linear_;
  std::vector<float> weights_;  // of the residuals, for FindBends
  std::vector<Eigen::Vector2f> bends_;
  std::vector<char> pose_is_free_;
  ceres::HuberLoss position_loss_{kPositionLossScale};
  std::vector<Prior> priors_;
  Eigen::VectorXd curvature_, of_priors_;
};

extern template class LinearBundle<4>;
extern template class LinearBundle<8>;
extern template class LinearBundle<kMaxCameraParams>;

}  // namespace cairn
