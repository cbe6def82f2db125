#include "cairn/solvers/affine_frame.h"

#include <Eigen/Geometry>

namespace cairn {

std::optional<LiftedFrame> LiftFrame(const Camera& camera, const Eigen::Vector2d& pixel,
                                     const Eigen::Matrix2d& shape, double depth,
                                     const Eigen::RowVector2d& depth_gradient) {
  Eigen::Matrix2d duv_dpixel;
  const std::optional<Eigen::Vector2d> uv = camera.CamFromImg(pixel, &duv_dpixel);
  if (!uv) return std::nullopt;
  const Eigen::Vector3d ray = uv->homogeneous();
  LiftedFrame lifted;
  lifted.point = depth * ray;
  lifted.derivative.noalias() = ray * (depth_gradient * shape);
  lifted.derivative.topRows<2>() += depth * duv_dpixel * shape;
  return lifted;
}

}  // namespace cairn
