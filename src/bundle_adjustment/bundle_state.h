#pragma once

#include <ceres/evaluation_callback.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <map>
#include <vector>

#include "cairn/bundle_adjustment/bundle_adjustment.h"

namespace cairn {

// A camera's intrinsics during the adjustment. The free parameters are few, so the parameter block
// holds these alone: the logarithm of a factor of the focal lengths first (they stay positive) and,
// where there are two, of a factor of their ratio x : y; then distortion coefficients, then the
// principal point.
struct IntrinsicsState {
  CameraModel model = CameraModel::kPinhole;
  int num_params = 0;
  int num_free = 0;
  int num_free_focal = 0;
  int first_principal_point = 0;  // among the free ones
  std::array<double, kMaxCameraParams> initial{};
  std::array<double, kMaxCameraParams> params{};  // in force at the present evaluation
  std::array<double, kMaxCameraParams> free{};    // the parameter block
  std::array<int, kMaxCameraParams> free_index{};

  void Update();
};

// A pose during the adjustment: x_cam = Exp(omega) R0 (x_world - center). omega starts at 0, so it
// never comes near the singularity of the exponential map, and no manifold is needed.
struct PoseState {
  std::array<double, 6> block{};  // omega, center
  Eigen::Matrix3d initial_rotation = Eigen::Matrix3d::Identity();
  // At the present evaluation: rotation, and the left Jacobian of the exponential map.
  Eigen::Matrix3d cam_from_world = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d left_jacobian = Eigen::Matrix3d::Identity();
  IntrinsicsState* intrinsics = nullptr;

  Eigen::Map<const Eigen::Vector3d> Center() const {
    return Eigen::Map<const Eigen::Vector3d>(block.data() + 3);
  }
  void Update();
};

// All that the cost functions read. Contiguous and in the order of the ids: Ceres orders parameter
// blocks by address, so this is what makes its sums, in one thread, the same in every run. The
// callback brings rotations, Jacobians and parameters up to date once an evaluation, not once an
// observation.
class BundleState : public ceres::EvaluationCallback {
 public:
  BundleState(const BundleAdjustmentScope& scope, const Reconstruction& reconstruction);

  void PrepareForEvaluation(bool evaluate_jacobians, bool new_evaluation_point) override;

  PoseState& Pose(image_t id) { return poses_[pose_index_.at(id)]; }
  // Those of the reconstruction, then those that were surveyed.
  Eigen::Vector3d& Point(size_t index) { return points_[index]; }
  IntrinsicsState& Intrinsics(camera_t id) { return intrinsics_[intrinsics_index_.at(id)]; }

  // All of them, in the order of their ids.
  std::vector<PoseState>& poses() { return poses_; }
  std::vector<IntrinsicsState>& intrinsics() { return intrinsics_; }
  std::vector<Eigen::Vector3d>& points() { return points_; }

  // What it was made of.
  const BundleAdjustmentScope& scope() const { return scope_; }
  const Reconstruction& reconstruction() const { return reconstruction_; }

  // Copies what was adjusted back.
  void Store(Reconstruction& reconstruction) const;

 private:
  const BundleAdjustmentScope& scope_;
  const Reconstruction& reconstruction_;
  std::vector<PoseState> poses_;
  std::vector<IntrinsicsState> intrinsics_;
  std::vector<Eigen::Vector3d> points_;
  std::map<image_t, size_t> pose_index_;
  std::map<camera_t, size_t> intrinsics_index_;
};

// d Exp(omega) y / d omega = -[Exp(omega) y]x LeftJacobian(omega) (Sola et al., "A micro Lie theory
// for state estimation in robotics", 2018, eq. 145).
Eigen::Matrix3d LeftJacobianSO3(const Eigen::Vector3d& omega);

}  // namespace cairn
