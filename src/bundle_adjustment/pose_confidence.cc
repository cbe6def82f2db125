#include "cairn/bundle_adjustment/pose_confidence.h"

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <vector>

#include "cairn/math/angles.h"
#include "cairn/math/so3.h"

namespace cairn {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

// Jacobians of an observation in its standard deviations: by the pose (omega, center) and the
// point.
struct Jacobians {
  Eigen::Matrix<double, 2, 6> pose;
  Eigen::Matrix<double, 2, 3> point;
};

Jacobians Linearize(const Camera& camera, const RegisteredImage& image, point2D_t keypoint,
                    const Eigen::Vector3d& xyz) {
  const Eigen::Matrix3d R = image.cam_from_world.RotationMatrix();
  const Eigen::Vector3d x = image.cam_from_world * xyz;
  Eigen::Matrix<double, 2, 3> pixel_by_x;
  if (!camera.ImgFromRay(x, &pixel_by_x)) pixel_by_x.setZero();
  const double sigma_px = image.sigmas_px.empty() ? 1.0 : image.sigmas_px[keypoint];
  const Eigen::Matrix<double, 2, 3> by_x = pixel_by_x / sigma_px;
  Jacobians jacobians;
  jacobians.pose.leftCols<3>() = -by_x * CrossMatrix(x);
  jacobians.pose.rightCols<3>() = -by_x * R;
  jacobians.point = by_x * R;
  return jacobians;
}

}  // namespace

std::map<image_t, PoseConfidence> EstimatePoseConfidence(const Reconstruction& reconstruction) {
  std::map<image_t, Matrix6> information;
  std::map<image_t, PoseConfidence> result;
  for (const auto& [id, image] : reconstruction.images) {
    information[id].setZero();
    result[id];
  }
  std::vector<Jacobians> jacobians;
  for (const auto& [id, point] : reconstruction.points3D) {
    jacobians.clear();
    Eigen::Matrix3d V = Eigen::Matrix3d::Zero();
    for (const TrackElement& element : point.track) {
      const RegisteredImage& image = reconstruction.images.at(element.image_id);
      jacobians.push_back(
          Linearize(reconstruction.CameraOf(image), image, element.point2D, point.xyz));
      V += jacobians.back().point.transpose() * jacobians.back().point;
    }
    const Eigen::Matrix3d V_inverse = V.inverse();
    if (!V_inverse.allFinite()) continue;
    for (size_t k = 0; k < jacobians.size(); ++k) {
      const auto& [J, Jp] = jacobians[k];
      const Eigen::Matrix<double, 6, 3> W = J.transpose() * Jp;
      information.at(point.track[k].image_id) += J.transpose() * J - W * V_inverse * W.transpose();
      ++result.at(point.track[k].image_id).num_points;
    }
  }
  for (auto& [id, confidence] : result) {
    const Eigen::LDLT<Matrix6> ldlt(information.at(id));
    confidence.rotation_sigma_deg = std::numeric_limits<double>::infinity();
    confidence.position_sigma = std::numeric_limits<double>::infinity();
    if (ldlt.info() != Eigen::Success || !(ldlt.vectorD().minCoeff() > 0)) continue;
    const Matrix6 covariance = ldlt.solve(Matrix6::Identity());
    confidence.rotation_sigma_deg = RadToDeg(std::sqrt(covariance.diagonal().head<3>().sum()));
    confidence.position_sigma = std::sqrt(covariance.diagonal().tail<3>().sum());
  }
  return result;
}

}  // namespace cairn
