#pragma once

#include <Eigen/Core>
#include <optional>

#include "cairn/base/rng.h"
#include "cairn/camera/camera.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/scene/features.h"

namespace cairn {

// A small textured piece of a surface: its point, and the two axes of its texture as tangents
// (world units; dX below). Seen from its front, where the normal
// -(tangent 1 x tangent 2) points, its image is not mirrored: the shape's determinant is positive.
struct SurfaceElement {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Matrix<double, 3, 2> tangents = Eigen::Matrix<double, 3, 2>::Zero();

  Eigen::Vector3d Normal() const { return tangents.col(1).cross(tangents.col(0)).normalized(); }
};

// An element with orthogonal axes of length `size` (world units), turned by `angle` (radians)
// around the normal, which need not have length 1.
SurfaceElement MakeSurfaceElement(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                                  double size, double angle);

// What an ideal detector and an ideal depth map give for a surface element, in double precision.
struct AffineObservation {
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  Eigen::Matrix2d shape = Eigen::Matrix2d::Identity();  // columns: the frame's axes in pixels
  double depth = 0;                                     // z-depth, world units
  Eigen::RowVector2d depth_gradient = Eigen::RowVector2d::Zero();  // per pixel

  Keypoint ToKeypoint() const;
  // depth_scale: units of the depth map per world unit.
  DepthSample ToDepthSample(double depth_scale = 1.0) const;
};

// The exact observation (Eichhardt and Barath 2020, synthetic evaluation, with the chain rule of
// src/solvers/README.md): pixel = pi(R X + t), shape = dpi R dX, depth = third row of R X + t, and
// gradient * shape = third row of R dX. Absent if the point is not in front of the camera or its
// surface is seen edge-on. The image's borders are not looked at.
std::optional<AffineObservation> Observe(const Camera& camera, const Rigid3d& cam_from_world,
                                         const SurfaceElement& element);

// Whether the pixel lies within the image.
bool IsInImage(const Camera& camera, const Eigen::Vector2d& pixel);

// Standard deviations of the Gaussian noise added to an observation.
struct ObservationNoise {
  double image_px = 0;        // each coordinate
  double affine = 0;          // each entry of the shape, relative to the frame's size sqrt(|det|)
  double depth = 0;           // relative to the depth
  double depth_gradient = 0;  // relative to depth / focal length: a slope of the surface
};

// focal_px gives the gradient noise its unit.
AffineObservation AddNoise(const AffineObservation& observation, const ObservationNoise& noise,
                           double focal_px, Rng& rng);

}  // namespace cairn
