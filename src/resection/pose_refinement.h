#pragma once

#include <span>

#include "cairn/resection/resection.h"

namespace cairn {

struct AbsolutePoseRefinementOptions {
  bool refine_focal = false;   // one factor of all focal lengths
  double loss_scale_px = 1.0;  // of Cauchy's loss
  int max_iterations = 50;
};

// Levenberg-Marquardt on the robust reprojection error of the correspondences with these indices,
// over the pose and, if wanted, the focal length. A step that takes a point behind the camera is
// none. Returns the number of accepted steps.
int RefinePose(const PixelsOfPoints& points, std::span<const int> indices,
               const AbsolutePoseRefinementOptions& options, Camera& camera,
               Rigid3d& cam_from_world);

}  // namespace cairn
