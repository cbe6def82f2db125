#pragma once

#include <Eigen/Core>
#include <optional>

#include "cairn/camera/camera.h"

namespace cairn {

// A local affine frame on the scene's surface, seen by one camera and known up to the unit of its
// depth map (src/solvers/README.md; paper, eq. 3).
struct LiftedFrame {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // a: position in the camera frame
  Eigen::Matrix<double, 3, 2> derivative =          // A: derivative of the position along the two
      Eigen::Matrix<double, 3, 2>::Zero();          //    axes of the frame in the image
};

// Lifts the frame at `pixel` with axes `shape` (columns, pixels) by the z-depth there and its
// gradient per pixel:
//   a = depth q,  A = q (gradient shape) + depth (dq/dpixel) shape,
// with q the ray of third component 1. nullopt where the camera model cannot undistort the pixel.
std::optional<LiftedFrame> LiftFrame(const Camera& camera, const Eigen::Vector2d& pixel,
                                     const Eigen::Matrix2d& shape, double depth,
                                     const Eigen::RowVector2d& depth_gradient);

// A local affine frame in normalized image coordinates: position and axes of the frame, both
// transformed by the camera's inverse projection.
struct NormalizedFrame {
  Eigen::Vector2d point = Eigen::Vector2d::Zero();
  Eigen::Matrix2d shape = Eigen::Matrix2d::Identity();
};

// An affine correspondence in normalized coordinates.
struct AffineCorrespondence {
  NormalizedFrame frame1;
  NormalizedFrame frame2;
};

}  // namespace cairn
