#include "cairn/bundle_adjustment/pose_confidence.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <vector>

#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"
#include "cairn/math/decompositions.h"
#include "cairn/math/so3.h"

namespace cairn {
namespace {

// Below this share of the largest, information is rounding.
constexpr double kMinInformation = 1e-10;
constexpr int kNumPointParts = 16;  // whose sums are taken side by side

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

// On the axes that `information` knows.
Eigen::Matrix3d InverseOfKnown(const Eigen::Matrix3d& information) {
  const EigenPairs<3> axes = SymmetricEigen(information);
  Eigen::Matrix3d inverse = Eigen::Matrix3d::Zero();
  for (int k = 0; k < 3; ++k) {
    if (!(axes.values[k] > kMinInformation * axes.values.maxCoeff())) continue;
    inverse += axes.vectors.col(k) * axes.vectors.col(k).transpose() / axes.values[k];
  }
  return inverse;
}

// Of three coordinates with three others free, from the blocks of their information: root of the
// sum of the variances.
double MarginalSigma(const Eigen::Matrix3d& own, const Eigen::Matrix3d& cross,
                     const Eigen::Matrix3d& others) {
  const Eigen::Matrix3d left = own - cross * InverseOfKnown(others) * cross.transpose();
  const Eigen::Vector3d values = SymmetricEigen(left).values;
  if (!(values.minCoeff() > kMinInformation * own.trace())) {
    return std::numeric_limits<double>::infinity();
  }
  return std::sqrt(values.cwiseInverse().sum());
}

// What points say of an image's pose.
struct PoseSum {
  Matrix6 information = Matrix6::Zero();
  int num_points = 0;
};
using PoseSums = std::map<image_t, PoseSum>;

void AddPoint(const Reconstruction& reconstruction, const Point3D& point,
              std::vector<Jacobians>& jacobians, PoseSums& sums) {
  jacobians.clear();
  Eigen::Matrix3d V = Eigen::Matrix3d::Zero();
  for (const TrackElement& element : point.track) {
    const RegisteredImage& image = reconstruction.images.at(element.image_id);
    jacobians.push_back(
        Linearize(reconstruction.CameraOf(image), image, element.point2D, point.xyz));
    V += jacobians.back().point.transpose() * jacobians.back().point;
  }
  const Eigen::Matrix3d V_inverse = V.inverse();
  if (!V_inverse.allFinite()) return;
  for (size_t k = 0; k < jacobians.size(); ++k) {
    const auto& [J, Jp] = jacobians[k];
    const Eigen::Matrix<double, 6, 3> W = J.transpose() * Jp;
    PoseSum& sum = sums[point.track[k].image_id];
    sum.information += J.transpose() * J - W * V_inverse * W.transpose();
    ++sum.num_points;
  }
}

// Of points in kNumPointParts parts: the sums do not depend on the number of threads.
std::vector<PoseSums> SumUpPoints(const Reconstruction& reconstruction, int num_threads) {
  std::vector<const Point3D*> points;
  for (const auto& [id, point] : reconstruction.points3D) points.push_back(&point);
  std::vector<PoseSums> parts(kNumPointParts);
  ParallelFor(num_threads, kNumPointParts, [&](int64_t part) {
    std::vector<Jacobians> jacobians;
    const auto end = static_cast<size_t>(part + 1) * points.size() / kNumPointParts;
    for (auto i = static_cast<size_t>(part) * points.size() / kNumPointParts; i < end; ++i) {
      AddPoint(reconstruction, *points[i], jacobians, parts[part]);
    }
  });
  return parts;
}

}  // namespace

std::map<image_t, PoseConfidence> EstimatePoseConfidence(const Reconstruction& reconstruction,
                                                         const RunContext& run) {
  PoseSums sums;
  for (const auto& [id, image] : reconstruction.images) sums[id];
  for (const PoseSums& part : SumUpPoints(reconstruction, run.num_threads)) {
    for (const auto& [id, sum] : part) {
      sums.at(id).information += sum.information;
      sums.at(id).num_points += sum.num_points;
    }
  }
  std::map<image_t, PoseConfidence> result;
  for (const auto& [id, sum] : sums) {
    const Matrix6& H = sum.information;
    const Eigen::Matrix3d rotation = H.topLeftCorner<3, 3>(), cross = H.topRightCorner<3, 3>(),
                          position = H.bottomRightCorner<3, 3>();
    result[id] = {.num_points = sum.num_points,
                  .rotation_sigma_deg = RadToDeg(MarginalSigma(rotation, cross, position)),
                  .position_sigma = MarginalSigma(position, cross.transpose(), rotation)};
  }
  return result;
}

}  // namespace cairn
