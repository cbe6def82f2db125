#include "two_view/prepare/lifting.h"

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace cairn::internal {

NormalizedFrame NormalizeFrame(const Camera& camera, const Keypoint& keypoint,
                               const Eigen::Vector3d& ray) {
  const Eigen::Vector2d x = ray.z() * ray.head<2>();
  Eigen::Matrix2d dpixel_dx;
  if (camera.IsPlanar()) {
    camera.ImgFromCam(x, &dpixel_dx);
  } else {
    Eigen::Matrix<double, 2, 3> dpixel_dray;
    camera.ImgFromRay(ray, &dpixel_dray);
    dpixel_dx = ray.z() * dpixel_dray.leftCols<2>();
  }
  return {x, dpixel_dx.inverse() * keypoint.Shape()};
}

LiftedFrame LiftNormalized(const NormalizedFrame& frame, const Keypoint& keypoint,
                           const DepthSample& sample) {
  const double gradient1 = sample.ddepth_dx * keypoint.a11 + sample.ddepth_dy * keypoint.a21;
  const double gradient2 = sample.ddepth_dx * keypoint.a12 + sample.ddepth_dy * keypoint.a22;
  LiftedFrame lifted;
  lifted.point = sample.depth * frame.point.homogeneous();
  lifted.derivative.col(0) = gradient1 * frame.point.homogeneous();
  lifted.derivative.col(1) = gradient2 * frame.point.homogeneous();
  lifted.derivative.topRows<2>() += sample.depth * frame.shape;
  return lifted;
}

}  // namespace cairn::internal
