#pragma once

#include "cairn/camera/camera.h"
#include "cairn/scene/features.h"
#include "cairn/solvers/affine_frame.h"

namespace cairn::internal {

// The keypoint's frame in normalized coordinates (x / z, y / z) at its ray, whose third component
// is 1, or -1 where it points backward.
NormalizedFrame NormalizeFrame(const Camera& camera, const Keypoint& keypoint,
                               const Eigen::Vector3d& ray);

// LiftFrame (solvers/affine_frame.h) of a keypoint whose normalized frame is known already.
LiftedFrame LiftNormalized(const NormalizedFrame& frame, const Keypoint& keypoint,
                           const DepthSample& sample);

}  // namespace cairn::internal
