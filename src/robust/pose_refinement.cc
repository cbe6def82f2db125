#include "robust/pose_refinement.h"

#include <Eigen/Geometry>

#include "cairn/base/check.h"
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
    Eigen::Quaterniond rotation;
    Eigen::Vector3d t;
    Eigen::Matrix<double, 3, 2> tangent;  // the directions in which t moves
  };

  PoseProblem(std::span<const WeightedPoints> groups, RobustLoss loss)
      : groups_(groups), loss_(loss) {}

  NormalEquations<5> Linearize(const State& at) const {
    NormalEquations<5> sum;
    const Eigen::Matrix3d R = at.rotation.toRotationMatrix();
    for (const WeightedPoints& group : groups_) {
      const NormalEquations<5> part =
          AccumulateSampson(*group.points, R, at.t, at.tangent, loss_, group.scale_px);
      const double weight = group.weight / (group.scale_px * group.scale_px);
      sum.hessian += weight * part.hessian;
      sum.gradient += weight * part.gradient;
      sum.cost += group.weight * part.cost;
    }
    return sum;
  }

  double Cost(const State& at) const {
    double sum = 0.0;
    const Eigen::Matrix3d R = at.rotation.toRotationMatrix();
    for (const WeightedPoints& group : groups_) {
      sum += group.weight * SampsonCost(*group.points, R, at.t, loss_, group.scale_px);
    }
    return sum;
  }

  State Moved(const State& from, const NormalEquations<5>::Vector& step) const {
    const Eigen::Vector3d t = (from.t + from.tangent * step.tail<2>()).normalized();
    return {(ExpSO3(step.head<3>()) * from.rotation).normalized(), t, TangentBasis(t)};
  }

 private:
  std::span<const WeightedPoints> groups_;
  RobustLoss loss_;
};

}  // namespace

PoseRefinementReport RefinePose(const PointPairs& points, const Rigid3d& start,
                                const PoseRefinementOptions& options) {
  const WeightedPoints group{&points, options.scale_px};
  return RefinePose({&group, 1}, start, options);
}

PoseRefinementReport RefinePose(std::span<const WeightedPoints> groups, const Rigid3d& start,
                                const PoseRefinementOptions& options) {
  const double norm = start.translation.norm();
  CAIRN_CHECK_GT(norm, 0.0);
  const Eigen::Vector3d t = start.translation / norm;
  PoseProblem::State state{start.rotation.normalized(), t, TangentBasis(t)};
  PoseProblem problem(groups, options.loss);
  const auto [cost, num_iterations, num_accepted] =
      Minimize(problem, {options.max_iterations, options.min_relative_gain}, &state);
  return {Rigid3d(state.rotation, state.t), cost, num_iterations};
}

Eigen::Matrix<double, 5, 5> PoseInformation(const PointPairs& points, const Rigid3d& pose,
                                            double scale_px) {
  const double norm = pose.translation.norm();
  CAIRN_CHECK_GT(norm, 0.0);
  const Eigen::Vector3d t = pose.translation / norm;
  return AccumulateSampson(points, pose.rotation.normalized().toRotationMatrix(), t,
                           TangentBasis(t), RobustLoss::kTruncated, scale_px)
      .hessian;
}

}  // namespace cairn
