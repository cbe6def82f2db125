#include "bundle_adjustment/reprojection_cost.h"

namespace cairn {

ReprojectionCost::ReprojectionCost(const Reprojection& reprojection) : reprojection_(reprojection) {
  set_num_residuals(2);
  const Reprojection::Free& free = reprojection.free;
  const int num_intrinsics = reprojection.pose->intrinsics->num_free;
  std::vector<int32_t>& sizes = *mutable_parameter_block_sizes();
  if (free.point) sizes.push_back(3);
  if (free.rotation || free.position) sizes.push_back(free.rotation && free.position ? 6 : 3);
  if (num_intrinsics > 0) sizes.push_back(num_intrinsics);
}

bool Reprojection::Evaluate(double* residuals, double** jacobians) const {
  const IntrinsicsState& intrinsics = *pose->intrinsics;
  const Eigen::Vector3d x = pose->cam_from_world * (*point - pose->Center());
  // Planar models go on behind the camera, so that a step may cross its plane.
  const bool is_planar = CameraModelIsPlanar(intrinsics.model);
  if (is_planar && x.z() == 0) return false;
  const double inverse_z = is_planar ? 1.0 / x.z() : 1.0;
  const Eigen::Vector3d ray =
      is_planar ? Eigen::Vector3d(x.x() * inverse_z, x.y() * inverse_z, 1.0) : x;
  Eigen::Vector2d projected;
  double J_params[2 * kMaxCameraParams];
  RowMajor2<3> J_camera;  // d(pixel)/d(ray), then d(residual)/d(x)
  const CameraParams params = {intrinsics.model, intrinsics.params.data()};
  if (!ImgFromRay(params, ray.data(), projected.data(), J_camera.data(),
                  jacobians && intrinsics.num_free > 0 ? J_params : nullptr)) {
    return false;
  }
  Eigen::Map<Eigen::Vector2d>(residuals, 2) = precision * PixelDifference(params, projected, pixel);
  if (!jacobians) return true;
  J_camera *= precision;
  if (is_planar) {
    J_camera *= inverse_z;
    J_camera.col(2) = -(J_camera.col(0) * ray.x() + J_camera.col(1) * ray.y());
  }
  FillJacobians(x, J_camera, J_params, jacobians);
  return true;
}

void Reprojection::FillJacobians(const Eigen::Vector3d& x, const RowMajor2<3>& J_camera,
                                 const double* J_params, double** jacobians) const {
  const IntrinsicsState& intrinsics = *pose->intrinsics;
  const RowMajor2<3> J_world = J_camera * pose->cam_from_world;
  // -J_camera [x]x left_jacobian: row times cross matrix is a cross product.
  RowMajor2<3> J_omega;
  if (free.rotation) {
    for (int row = 0; row < 2; ++row) {
      J_omega.row(row) = x.cross(J_camera.row(row).transpose()).transpose() * pose->left_jacobian;
    }
  }
  int block = 0;
  if (free.point) {
    if (double* J = jacobians[block]) Eigen::Map<RowMajor2<3>>{J} = J_world;
    ++block;
  }
  if (free.rotation || free.position) {
    if (double* J = jacobians[block]) {
      if (free.rotation && free.position) {
        Eigen::Map<RowMajor2<6>> J_pose(J);
        J_pose.leftCols<3>() = J_omega;
        J_pose.rightCols<3>() = -J_world;
      } else {
        Eigen::Map<RowMajor2<3>>{J} = free.rotation ? J_omega : RowMajor2<3>(-J_world);
      }
    }
    ++block;
  }
  if (intrinsics.num_free > 0) {
    if (double* J = jacobians[block]) {
      for (int row = 0; row < 2; ++row) {
        for (int i = 0; i < intrinsics.num_free; ++i) {
          const int k = intrinsics.free_index[i];
          const double factor =
              precision * (i < intrinsics.num_free_focal ? intrinsics.params[k] : 1.0);
          J[row * intrinsics.num_free + i] = factor * J_params[row * intrinsics.num_params + k];
        }
        if (intrinsics.num_free_focal < 2) continue;
        // By log fx and log fy so far, see IntrinsicsState.
        double* const focals = J + row * intrinsics.num_free;
        const double by_x = focals[0], by_y = focals[1];
        focals[0] = by_x + by_y;
        focals[1] = 0.5 * (by_x - by_y);
      }
    }
  }
}

}  // namespace cairn
