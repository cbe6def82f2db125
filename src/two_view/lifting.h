#pragma once

#include "cairn/camera/camera.h"
#include "cairn/scene/features.h"
#include "cairn/solvers/affine_frame.h"

namespace cairn::internal {

// The keypoint's frame in normalized coordinates, at its undistorted position x.
NormalizedFrame NormalizeFrame(const Camera& camera, const Keypoint& keypoint,
                               const Eigen::Vector2d& x);

// LiftFrame (solvers/affine_frame.h) of a keypoint whose normalized frame is known already.
LiftedFrame LiftNormalized(const NormalizedFrame& frame, const Keypoint& keypoint,
                           const DepthSample& sample);

}  // namespace cairn::internal
