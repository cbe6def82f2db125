#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "cairn/camera/camera.h"
#include "cairn/geometry/rigid3d.h"

namespace cairn {

// Levenberg-Marquardt on the reprojection error of the given correspondences with Cauchy's loss of
// scale loss_scale_px, over the pose and, if wanted, one factor of all focal lengths. Points behind
// the camera end a step. Returns the number of accepted steps.
int RefinePose(std::span<const Eigen::Vector2d> pixels, std::span<const Eigen::Vector3d> xyz,
               std::span<const int> indices, bool refine_focal, double loss_scale_px,
               int max_iterations, Camera& camera, Rigid3d& cam_from_world);

}  // namespace cairn
