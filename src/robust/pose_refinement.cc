#include "cairn/robust/pose_refinement.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "cairn/base/check.h"
#include "cairn/math/so3.h"

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

using Vector5d = Eigen::Matrix<double, 5, 1>;
using Matrix5d = Eigen::Matrix<double, 5, 5>;

// Solves A x = b by Cholesky's decomposition of the lower triangle. False if A is not positive.
bool SolveCholesky(Matrix5d A, Vector5d b, Vector5d* x) {
  for (int j = 0; j < 5; ++j) {
    double d = A(j, j);
    for (int k = 0; k < j; ++k) d -= A(j, k) * A(j, k);
    if (!(d > 0.0)) return false;
    const double inverse = 1.0 / std::sqrt(d);
    A(j, j) = inverse;
    for (int i = j + 1; i < 5; ++i) {
      double sum = A(i, j);
      for (int k = 0; k < j; ++k) sum -= A(i, k) * A(j, k);
      A(i, j) = sum * inverse;
    }
  }
  for (int i = 0; i < 5; ++i) {
    for (int k = 0; k < i; ++k) b[i] -= A(i, k) * b[k];
    b[i] *= A(i, i);
  }
  for (int i = 4; i >= 0; --i) {
    for (int k = i + 1; k < 5; ++k) b[i] -= A(k, i) * b[k];
    b[i] *= A(i, i);
  }
  *x = b;
  return true;
}

// The sum over groups, each as a loss of at most its weight.
SampsonNormalEquations Linearize(std::span<const WeightedPoints> groups, const Eigen::Matrix3d& R,
                                 const Eigen::Vector3d& t,
                                 const Eigen::Matrix<double, 3, 2>& tangent, RobustLoss loss) {
  SampsonNormalEquations sum;
  sum.hessian.setZero();
  sum.gradient.setZero();
  for (const WeightedPoints& group : groups) {
    const SampsonNormalEquations part =
        AccumulateSampson(*group.points, R, t, tangent, loss, group.scale_px);
    const double weight = group.weight / (group.scale_px * group.scale_px);
    sum.hessian += weight * part.hessian;
    sum.gradient += weight * part.gradient;
    sum.cost += group.weight * part.cost;
  }
  return sum;
}

double Cost(std::span<const WeightedPoints> groups, const Eigen::Matrix3d& R,
            const Eigen::Vector3d& t, RobustLoss loss) {
  double sum = 0.0;
  for (const WeightedPoints& group : groups) {
    sum += group.weight * SampsonCost(*group.points, R, t, loss, group.scale_px);
  }
  return sum;
}

// A step whose gain would end the refinement if the cost were quadratic, or nearly so.
bool IsProbablyLast(const SampsonNormalEquations& equations, const Vector5d& step,
                    const PoseRefinementOptions& options) {
  constexpr double kMargin = 2.0;
  const double expected_gain = -equations.gradient.dot(step);
  return expected_gain < kMargin * options.min_relative_gain * equations.cost;
}

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
  Eigen::Quaterniond rotation = start.rotation.normalized();
  Eigen::Vector3d t = start.translation / norm;
  Eigen::Matrix<double, 3, 2> tangent = TangentBasis(t);
  SampsonNormalEquations equations =
      Linearize(groups, rotation.toRotationMatrix(), t, tangent, options.loss);
  PoseRefinementReport report;
  double lambda = 1e-3;
  while (report.num_iterations < options.max_iterations) {
    ++report.num_iterations;
    Matrix5d damped = equations.hessian;
    const double floor = 1e-9 * damped.diagonal().maxCoeff();
    for (int i = 0; i < 5; ++i) damped(i, i) += lambda * std::max(damped(i, i), floor);
    Vector5d step;
    if (!SolveCholesky(damped, -equations.gradient, &step)) break;
    const double length = step.norm();
    if (!(length > options.min_step)) break;  // also when not finite
    const Eigen::Quaterniond next_rotation = (ExpSO3(step.head<3>()) * rotation).normalized();
    const Eigen::Matrix3d next_R = next_rotation.toRotationMatrix();
    const Eigen::Vector3d next_t = (t + tangent * step.tail<2>()).normalized();
    const Eigen::Matrix<double, 3, 2> next_tangent = TangentBasis(next_t);
    auto linearize = [&] { return Linearize(groups, next_R, next_t, next_tangent, options.loss); };
    // Nobody needs the derivatives at the end.
    const bool only_cost =
        report.num_iterations == options.max_iterations || IsProbablyLast(equations, step, options);
    SampsonNormalEquations next;
    if (only_cost) {
      next.cost = Cost(groups, next_R, next_t, options.loss);
    } else {
      next = linearize();
    }
    const double gain = equations.cost - next.cost;
    if (!(gain > 0.0)) {
      lambda *= 10.0;
      if (lambda > 1e6) break;
      continue;
    }
    const bool is_end = gain < options.min_relative_gain * equations.cost ||
                        report.num_iterations == options.max_iterations;
    rotation = next_rotation;
    t = next_t;
    tangent = next_tangent;
    lambda = std::max(lambda * 0.1, 1e-8);
    equations = only_cost && !is_end ? linearize() : next;
    if (is_end) break;
  }
  report.cam2_from_cam1 = Rigid3d(rotation, t);
  report.cost = equations.cost;
  return report;
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
