#include "robust/pose_refinement.h"

#include <Eigen/Geometry>
#include <cmath>

#include "cairn/base/check.h"
#include "cairn/math/decompositions.h"
#include "cairn/math/so3.h"
#include "math/levenberg_marquardt.h"

namespace cairn {
namespace {

// Two unit vectors orthogonal to the unit vector t.
Eigen::Matrix<double, 3, 2> TangentBasis(const Eigen::Vector3d& t) {
  int smallest;
  t.cwiseAbs().minCoeff(&smallest);
  Eigen::Matrix<double, 3, 2> basis;
  basis.col(0) = t.cross(Eigen::Vector3d::Unit(smallest)).normalized();
  basis.col(1) = t.cross(basis.col(0));
  return basis;
}

// The sum over groups, each as a loss of at most its weight.
class PoseProblem {
 public:
  struct State {
    Rigid3d pose;                         // |t| = 1
    Eigen::Matrix<double, 3, 2> tangent;  // the directions in which t moves

    State(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& direction)
        : pose(rotation.normalized(), direction.normalized()),
          tangent(TangentBasis(pose.translation)) {}
  };

  PoseProblem(std::span<const WeightedPoints> groups, RobustLoss loss)
      : groups_(groups), loss_(loss) {}

  NormalEquations<5> Linearize(const State& at) const {
    NormalEquations<5> sum;
    for (const WeightedPoints& group : groups_) {
      const NormalEquations<5> part =
          AccumulateSampson(*group.points, at.pose, at.tangent, loss_, group.scale_px);
      const double weight = group.weight / (group.scale_px * group.scale_px);
      sum.hessian += weight * part.hessian;
      sum.gradient += weight * part.gradient;
      sum.cost += group.weight * part.cost;
    }
    return sum;
  }

  double Cost(const State& at) const {
    double sum = 0.0;
    for (const WeightedPoints& group : groups_) {
      sum += group.weight * SampsonCost(*group.points, at.pose, loss_, group.scale_px);
    }
    return sum;
  }

  State Moved(const State& from, const NormalEquations<5>::Vector& step) const {
    return {ExpSO3(step.head<3>()) * from.pose.rotation,
            from.pose.translation + from.tangent * step.tail<2>()};
  }

 private:
  std::span<const WeightedPoints> groups_;
  RobustLoss loss_;
};

}  // namespace

Rigid3d RefinePose(const PointPairs& points, const Rigid3d& start,
                   const PoseRefinementOptions& options) {
  const WeightedPoints group{&points, options.scale_px};
  return RefinePose({&group, 1}, start, options);
}

Rigid3d RefinePose(std::span<const WeightedPoints> groups, const Rigid3d& start,
                   const PoseRefinementOptions& options) {
  CAIRN_CHECK_GT(start.translation.norm(), 0.0);
  PoseProblem::State state(start.rotation, start.translation);
  PoseProblem problem(groups, options.loss);
  Minimize(problem, {options.max_iterations, options.min_relative_gain}, &state);
  return state.pose;
}

PoseSigmas SigmasOfPose(const PointPairs& points, const Rigid3d& pose, double scale_px) {
  CAIRN_CHECK_GT(pose.translation.norm(), 0.0);
  const PoseProblem::State at(pose.rotation, pose.translation);
  const auto [values, vectors] = SymmetricEigen(
      AccumulateSampson(points, at.pose, at.tangent, RobustLoss::kTruncated, scale_px).hessian);
  const double floor = 1e-12 * values[4];
  const Eigen::Matrix<double, 5, 5> covariance =
      vectors * values.cwiseMax(floor).cwiseInverse().asDiagonal() * vectors.transpose();
  const Eigen::Matrix3d rotation = covariance.topLeftCorner<3, 3>();
  const Eigen::Matrix2d translation = covariance.bottomRightCorner<2, 2>();
  return {std::sqrt(SymmetricEigen(rotation).values[2]),
          std::sqrt(SymmetricEigen(translation).values[1])};
}

}  // namespace cairn
