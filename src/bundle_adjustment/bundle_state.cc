#include "bundle_adjustment/bundle_state.h"

#include <cmath>

#include "cairn/base/check.h"
#include "cairn/math/so3.h"

namespace cairn {

Eigen::Matrix3d LeftJacobianSO3(const Eigen::Vector3d& omega) {
  const double squared = omega.squaredNorm();
  const double angle = std::sqrt(squared);
  // (1 - cos a) / a^2 and (a - sin a) / a^3, by their series near zero.
  double b = 0.5 - squared / 24.0;
  double c = 1.0 / 6.0 - squared / 120.0;
  if (angle > 1e-2) {
    b = (1.0 - std::cos(angle)) / squared;
    c = (angle - std::sin(angle)) / (squared * angle);
  }
  const Eigen::Matrix3d W = CrossMatrix(omega);
  return Eigen::Matrix3d::Identity() + b * W + c * W * W;
}

namespace {

// Where no distortion is a standstill, since its derivative is 0 there (FOV), it begins beside
// that, as new cameras do.
double FirstDistortion(const Camera& camera, int k) {
  if (camera.params[k] != 0) return camera.params[k];
  return Camera::FromFocal(camera.camera_id, camera.model, camera.MeanFocal(), camera.width,
                           camera.height)
      .params[k];
}

}  // namespace

void IntrinsicsState::Update() {
  for (int i = num_free_focal; i < num_free; ++i) params[free_index[i]] = free[i];
  const double half_ratio = num_free_focal == 2 ? 0.5 * free[1] : 0.0;
  for (int i = 0; i < num_free_focal; ++i) {
    const int k = free_index[i];
    params[k] = initial[k] * std::exp(free[0] + (i == 0 ? half_ratio : -half_ratio));
  }
}

void PoseState::Update() {
  const Eigen::Map<const Eigen::Vector3d> omega(block.data());
  cam_from_world = ExpSO3(omega).toRotationMatrix() * initial_rotation;
  left_jacobian = LeftJacobianSO3(omega);
}

BundleState::BundleState(const BundleAdjustmentScope& scope, const Reconstruction& reconstruction)
    : scope_(scope), reconstruction_(reconstruction) {
  intrinsics_.reserve(reconstruction.cameras.size());
  for (const auto& [id, camera] : reconstruction.cameras) {
    IntrinsicsState state;
    state.model = camera.model;
    state.num_params = static_cast<int>(camera.params.size());
    CAIRN_CHECK_LE(state.num_params, kMaxCameraParams);
    std::copy(camera.params.begin(), camera.params.end(), state.initial.begin());
    state.params = state.initial;
    if (!scope.fixed_cameras.contains(id)) {
      if (scope.focal_lengths) {
        for (const int k : camera.FocalIndices()) state.free_index[state.num_free++] = k;
        state.num_free_focal = state.num_free;
      }
      if (scope.distortions) {
        for (const int k : camera.DistortionIndices()) {
          state.free[state.num_free] = FirstDistortion(camera, k);
          state.free_index[state.num_free++] = k;
        }
      }
      state.first_principal_point = state.num_free;
      const auto prior = scope.priors.find(id);
      if (scope.principal_points && prior != scope.priors.end() &&
          prior->second.principal_point_sigma_px > 0) {
        for (const int k : camera.PrincipalPointIndices()) {
          state.free[state.num_free] = camera.params[k];
          state.free_index[state.num_free++] = k;
        }
      }
    }
    intrinsics_index_[id] = intrinsics_.size();
    intrinsics_.push_back(state);
  }
  poses_.reserve(reconstruction.images.size());
  for (const auto& [id, image] : reconstruction.images) {
    PoseState pose;
    pose.initial_rotation = image.cam_from_world.RotationMatrix();
    Eigen::Map<Eigen::Vector3d>(pose.block.data() + 3) = image.cam_from_world.Center();
    pose.intrinsics = &intrinsics_[intrinsics_index_.at(image.image.camera_id)];
    pose.Update();
    pose_index_[id] = poses_.size();
    poses_.push_back(pose);
  }
  points_.reserve(reconstruction.points3D.size() + scope.surveyed_points.size());
  for (const auto& [id, point] : reconstruction.points3D) points_.push_back(point.xyz);
  for (const SurveyedPoint& point : scope.surveyed_points) points_.push_back(point.prior.position);
}

void BundleState::PrepareForEvaluation(bool evaluate_jacobians, bool new_evaluation_point) {
  if (!new_evaluation_point) return;
  for (IntrinsicsState& intrinsics : intrinsics_) intrinsics.Update();
  for (PoseState& pose : poses_) pose.Update();
}

void BundleState::Store(Reconstruction& reconstruction) const {
  size_t i = 0;
  for (auto& [id, camera] : reconstruction.cameras) {
    IntrinsicsState intrinsics = intrinsics_[i++];
    intrinsics.Update();
    std::copy_n(intrinsics.params.begin(), intrinsics.num_params, camera.params.begin());
    // It is even in its angle.
    if (camera.model == CameraModel::kFov) camera.params[4] = std::abs(camera.params[4]);
  }
  for (auto& [id, image] : reconstruction.images) {
    if (scope_.fixed_images.contains(id)) continue;
    const PoseState& pose = poses_[pose_index_.at(id)];
    Rigid3d& cam_from_world = image.cam_from_world;
    if (scope_.rotations) {
      const Eigen::Vector3d omega(pose.block[0], pose.block[1], pose.block[2]);
      cam_from_world.rotation = (ExpSO3(omega) * cam_from_world.rotation).normalized();
    }
    if (scope_.rotations || scope_.positions) {
      cam_from_world.translation = cam_from_world.rotation * -pose.Center();
    }
  }
  i = 0;
  for (auto& [id, point] : reconstruction.points3D) point.xyz = points_[i++];
}

}  // namespace cairn
