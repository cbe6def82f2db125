#include "cairn/bundle_adjustment/pose_confidence.h"

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <vector>

#include "bundle_adjustment/check_bundle.h"
#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"
#include "cairn/math/decompositions.h"
#include "cairn/math/so3.h"
#include "scene/view_table.h"

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

Jacobians Linearize(const ViewTable::View& view, point2D_t keypoint, const Eigen::Vector3d& xyz) {
  const Eigen::Matrix3d R = view.image->cam_from_world.RotationMatrix();
  const Eigen::Vector3d x = view.image->cam_from_world * xyz;
  Eigen::Matrix<double, 2, 3> pixel_by_x;
  if (!view.camera->ImgFromRay(x, &pixel_by_x)) pixel_by_x.setZero();
  const Eigen::Matrix<double, 2, 3> by_x = pixel_by_x / view.SigmaPx(keypoint);
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
using PoseSums = std::vector<PoseSum>;  // by ViewTable's index

void AddPoint(const ViewTable& views, const Point3D& point, std::vector<Jacobians>& jacobians,
              PoseSums& sums) {
  jacobians.clear();
  Eigen::Matrix3d V = Eigen::Matrix3d::Zero();
  for (const TrackElement& element : point.track) {
    jacobians.push_back(Linearize(views.Of(element.image_id), element.point2D, point.xyz));
    V += jacobians.back().point.transpose() * jacobians.back().point;
  }
  const Eigen::Matrix3d V_inverse = V.inverse();
  if (!V_inverse.allFinite()) return;
  for (size_t k = 0; k < jacobians.size(); ++k) {
    const auto& [J, Jp] = jacobians[k];
    const Eigen::Matrix<double, 6, 3> W = J.transpose() * Jp;
    PoseSum& sum = sums[views.Of(point.track[k].image_id).index];
    sum.information += J.transpose() * J - W * V_inverse * W.transpose();
    ++sum.num_points;
  }
}

// Of points in kNumPointParts parts: the sums do not depend on the number of threads.
PoseSums SumUpPoints(const Reconstruction& reconstruction, int num_threads) {
  const ViewTable views(reconstruction);
  std::vector<const Point3D*> points;
  for (const auto& [id, point] : reconstruction.points3D) points.push_back(&point);
  std::vector<PoseSums> parts(kNumPointParts);
  ParallelFor(num_threads, kNumPointParts, [&](int64_t part) {
    parts[part].resize(views.size());
    std::vector<Jacobians> jacobians;
    const auto end = static_cast<size_t>(part + 1) * points.size() / kNumPointParts;
    for (auto i = static_cast<size_t>(part) * points.size() / kNumPointParts; i < end; ++i) {
      AddPoint(views, *points[i], jacobians, parts[part]);
    }
  });
  PoseSums sums(views.size());
  for (const PoseSums& part : parts) {
    for (size_t i = 0; i < sums.size(); ++i) {
      sums[i].information += part[i].information;
      sums[i].num_points += part[i].num_points;
    }
  }
  return sums;
}

}  // namespace

std::map<image_t, PoseConfidence> EstimatePoseConfidence(const Reconstruction& reconstruction,
                                                         const RunContext& run) {
  CheckBundle(reconstruction, {});
  const PoseSums sums = SumUpPoints(reconstruction, run.num_threads);
  std::map<image_t, PoseConfidence> result;
  size_t next = 0;
  for (const auto& [id, image] : reconstruction.images) {
    const PoseSum& sum = sums[next++];
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
