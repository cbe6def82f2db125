#include "cairn/solvers/one_affine_depth.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

#include "cairn/math/so3.h"

namespace cairn {
namespace {

using Matrix32 = Eigen::Matrix<double, 3, 2>;

// Frames whose two axes span less than this sine are singular.
constexpr double kMinSine = 1e-6;

// The surface normal, toward or away from the camera by the handedness of the axes. False if the
// axes are (nearly) parallel.
bool Normal(const Matrix32& derivative, Eigen::Vector3d* normal) {
  *normal = derivative.col(0).cross(derivative.col(1));
  const double squared_norm = normal->squaredNorm();
  const double squared_size = derivative.col(0).squaredNorm() * derivative.col(1).squaredNorm();
  if (!(squared_norm > kMinSine * kMinSine * squared_size)) return false;
  *normal /= std::sqrt(squared_norm);
  return true;
}

// det(A of the image shape) has the sign of the triple product of the point and the two axes:
// frames seen as mirror images of each other, or points behind a camera, cannot be one surface.
bool CanBeOneSurface(const LiftedFrame& frame1, const LiftedFrame& frame2,
                     const Eigen::Vector3d& normal1, const Eigen::Vector3d& normal2) {
  return frame1.point.z() > 0 && frame2.point.z() > 0 &&
         frame1.point.dot(normal1) * frame2.point.dot(normal2) > 0;
}

// Scale and translation, once the rotation is known.
int FinishModel(const LiftedFrame& frame1, const LiftedFrame& frame2, const Eigen::Matrix3d& R,
                ScaledPose* model) {
  const double scale = (R * frame1.derivative).cwiseProduct(frame2.derivative).sum() /
                       frame1.derivative.squaredNorm();
  if (!(scale > 0) || !std::isfinite(scale)) return 0;
  model->scale = scale;
  model->cam2_from_cam1 = Rigid3d(R, frame2.point - scale * (R * frame1.point));
  return 1;
}

// Orthonormal frame of the plane that keeps the second axis exactly (paper, algorithm 1).
Eigen::Matrix3d OrthonormalFrame(const Matrix32& derivative, const Eigen::Vector3d& normal) {
  Eigen::Matrix3d frame;
  frame.col(0) = normal;
  frame.col(2) = derivative.col(1).normalized();
  frame.col(1) = frame.col(2).cross(normal);
  return frame;
}

}  // namespace

int OneAffineDepthProposed::Solve(const Sample* samples, Model* models) {
  const LiftedFrame& frame1 = samples->frame1;
  const LiftedFrame& frame2 = samples->frame2;
  Eigen::Vector3d normal1, normal2;
  if (!Normal(frame1.derivative, &normal1) || !Normal(frame2.derivative, &normal2)) return 0;
  if (!CanBeOneSurface(frame1, frame2, normal1, normal2)) return 0;
  const Eigen::Matrix3d R = OrthonormalFrame(frame2.derivative, normal2) *
                            OrthonormalFrame(frame1.derivative, normal1).transpose();
  return FinishModel(frame1, frame2, R, models);
}

int OneAffineDepthUmeyama::Solve(const Sample* samples, Model* models) {
  const LiftedFrame& frame1 = samples->frame1;
  const LiftedFrame& frame2 = samples->frame2;
  Eigen::Vector3d normal1, normal2;
  if (!Normal(frame1.derivative, &normal1) || !Normal(frame2.derivative, &normal2)) return 0;
  if (!CanBeOneSurface(frame1, frame2, normal1, normal2)) return 0;
  const Eigen::Matrix3d covariance = frame2.derivative * frame1.derivative.transpose();
  return FinishModel(frame1, frame2, NearestRotation(covariance), models);
}

}  // namespace cairn
