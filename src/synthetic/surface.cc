#include "cairn/synthetic/surface.h"

#include <Eigen/LU>
#include <cmath>

#include "cairn/base/check.h"

namespace cairn {

SurfaceElement MakeSurfaceElement(const Eigen::Vector3d& point, const Eigen::Vector3d& normal,
                                  double size, double angle) {
  const Eigen::Vector3d n = normal.normalized();
  CAIRN_CHECK(n.allFinite());
  const Eigen::Vector3d u = n.unitOrthogonal();
  const Eigen::Vector3d v = u.cross(n);  // u x v = -n.
  SurfaceElement element;
  element.point = point;
  element.tangents.col(0) = size * (std::cos(angle) * u + std::sin(angle) * v);
  element.tangents.col(1) = size * (-std::sin(angle) * u + std::cos(angle) * v);
  return element;
}

Keypoint AffineObservation::ToKeypoint() const {
  return {static_cast<float>(pixel.x()),   static_cast<float>(pixel.y()),
          static_cast<float>(shape(0, 0)), static_cast<float>(shape(0, 1)),
          static_cast<float>(shape(1, 0)), static_cast<float>(shape(1, 1))};
}

DepthSample AffineObservation::ToDepthSample(double depth_scale) const {
  return {static_cast<float>(depth_scale * depth),
          static_cast<float>(depth_scale * depth_gradient.x()),
          static_cast<float>(depth_scale * depth_gradient.y()), true};
}

std::optional<AffineObservation> Observe(const Camera& camera, const Rigid3d& cam_from_world,
                                         const SurfaceElement& element) {
  const Eigen::Vector3d x = cam_from_world * element.point;
  const Eigen::Matrix<double, 3, 2> dX = cam_from_world.RotationMatrix() * element.tangents;

  AffineObservation out;
  Eigen::Matrix<double, 2, 3> J_x;
  const auto pixel = camera.ImgFromRay(x, &J_x);
  if (!pixel) return std::nullopt;
  out.pixel = *pixel;
  out.shape = J_x * dX;
  out.depth = x.z();
  // Seen edge-on: the frame's image is (nearly) a line, and the depth gradient unbounded.
  const double det = out.shape.determinant();
  if (!(std::abs(det) > 1e-9 * out.shape.squaredNorm())) return std::nullopt;
  out.depth_gradient = dX.row(2) * out.shape.inverse();
  return out;
}

bool IsInImage(const Camera& camera, const Eigen::Vector2d& pixel) {
  return pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() <= camera.width &&
         pixel.y() <= camera.height;
}

AffineObservation AddNoise(const AffineObservation& observation, const ObservationNoise& noise,
                           double focal_px, Rng& rng) {
  AffineObservation out = observation;
  const double size = std::sqrt(std::abs(observation.shape.determinant()));
  const double slope = observation.depth / focal_px;
  for (int i = 0; i < 2; ++i) {
    out.pixel[i] += noise.image_px * rng.Gaussian();
    out.depth_gradient[i] += noise.depth_gradient * slope * rng.Gaussian();
    for (int j = 0; j < 2; ++j) out.shape(i, j) += noise.affine * size * rng.Gaussian();
  }
  out.depth *= 1.0 + noise.depth * rng.Gaussian();
  return out;
}

}  // namespace cairn
