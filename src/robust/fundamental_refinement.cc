#include "cairn/robust/fundamental_refinement.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "cairn/base/check.h"
#include "cairn/math/so3.h"

namespace cairn {
namespace {

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Vector9d = Eigen::Matrix<double, 9, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;
using Matrix9d = Eigen::Matrix<double, 9, 9>;
using Matrix97d = Eigen::Matrix<double, 9, 7>;

struct Parameters {
  Eigen::Matrix3d U, V;  // rotations
  double angle;          // of the singular values (cos, sin, 0)

  Eigen::DiagonalMatrix<double, 3> SingularValues() const {
    return Eigen::DiagonalMatrix<double, 3>(std::cos(angle), std::sin(angle), 0.0);
  }
  Eigen::Matrix3d F() const { return U * SingularValues() * V.transpose(); }
};

Parameters Decompose(const Eigen::Matrix3d& F) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Parameters parameters{svd.matrixU(), svd.matrixV(), 0.0};
  // The third columns have no weight, so that both matrices can be made rotations.
  if (parameters.U.determinant() < 0.0) parameters.U.col(2) *= -1.0;
  if (parameters.V.determinant() < 0.0) parameters.V.col(2) *= -1.0;
  parameters.angle = std::atan2(svd.singularValues()[1], svd.singularValues()[0]);
  return parameters;
}

// U <- U Exp(step 0..2), V <- V Exp(step 3..5), angle += step 6.
Parameters Move(const Parameters& from, const Vector7d& step) {
  return {from.U * ExpSO3(step.head<3>()).toRotationMatrix(),
          from.V * ExpSO3(step.segment<3>(3)).toRotationMatrix(), from.angle + step[6]};
}

// Derivative of F's elements, by columns, by the seven steps.
Matrix97d Derivative(const Parameters& at) {
  Matrix97d derivative;
  auto set = [&](int column, const Eigen::Matrix3d& d) {
    derivative.col(column) = Eigen::Map<const Vector9d>(d.data());
  };
  const Eigen::Matrix3d S = at.SingularValues();
  for (int k = 0; k < 3; ++k) {
    const Eigen::Matrix3d K = CrossMatrix(Eigen::Vector3d::Unit(k));
    set(k, at.U * K * S * at.V.transpose());
    set(3 + k, -at.U * S * K * at.V.transpose());
  }
  const Eigen::Vector3d ds(-std::sin(at.angle), std::cos(at.angle), 0.0);
  set(6, at.U * ds.asDiagonal() * at.V.transpose());
  return derivative;
}

struct NormalEquations {
  Matrix9d hessian;  // of F's elements, lower triangle
  Vector9d gradient;
  double cost = 0.0;
};

NormalEquations Accumulate(const PointPairs& points, const Eigen::Matrix3d& F, double scale_px) {
  NormalEquations sums;
  sums.hessian.setZero();
  sums.gradient.setZero();
  const double w1 = 1.0 / (points.focal1_px() * points.focal1_px());
  const double w2 = 1.0 / (points.focal2_px() * points.focal2_px());
  const double squared_scale = scale_px * scale_px;
  for (int i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d x1 = points.Point1(i).homogeneous(), x2 = points.Point2(i).homogeneous();
    Eigen::Vector3d line2 = F * x1, line1 = F.transpose() * x2;
    const double algebraic = x2.dot(line2);
    line1 = Eigen::Vector3d(w1 * line1.x(), w1 * line1.y(), 0.0);
    line2 = Eigen::Vector3d(w2 * line2.x(), w2 * line2.y(), 0.0);
    const double squared_gradient = line1.squaredNorm() / w1 + line2.squaredNorm() / w2;
    if (!(squared_gradient > 0.0)) continue;  // both points at their epipoles: no error
    const double inverse = 1.0 / std::sqrt(squared_gradient);
    const double error = algebraic * inverse;
    const double weight = squared_scale / (squared_scale + error * error);
    sums.cost += 1.0 - weight;
    // d error / d F = (x2 x1^T - C / S (line2 x1^T + x2 line1^T)) / sqrt(S)
    const double ratio = algebraic * inverse * inverse;
    const Eigen::Vector3d left = inverse * (x2 - ratio * line2), right = -inverse * ratio * line1;
    Vector9d J;
    for (int column = 0; column < 3; ++column) {
      J.segment<3>(3 * column) = left * x1[column] + x2 * right[column];
    }
    const double squared_weight = weight * weight;
    sums.gradient += squared_weight * error * J;
    for (int column = 0; column < 9; ++column) {
      const double scaled = squared_weight * J[column];
      for (int row = column; row < 9; ++row) sums.hessian(row, column) += scaled * J[row];
    }
  }
  return sums;
}

}  // namespace

FundamentalRefinementReport RefineFundamentalMatrix(const PointPairs& points,
                                                    const Eigen::Matrix3d& start,
                                                    const FundamentalRefinementOptions& options) {
  CAIRN_CHECK_GT(start.norm(), 0.0);
  Parameters parameters = Decompose(start);
  NormalEquations equations = Accumulate(points, parameters.F(), options.scale_px);
  FundamentalRefinementReport report;
  double lambda = 1e-3;
  while (report.num_iterations < options.max_iterations) {
    ++report.num_iterations;
    const Matrix97d D = Derivative(parameters);
    Matrix7d hessian = D.transpose() * equations.hessian.selfadjointView<Eigen::Lower>() * D;
    const double floor = 1e-12 * hessian.diagonal().maxCoeff();
    hessian.diagonal() += lambda * hessian.diagonal().cwiseMax(floor);
    const Vector7d step = -hessian.ldlt().solve(D.transpose() * equations.gradient);
    if (!(step.norm() > options.min_step)) break;  // also when not finite
    const Parameters next = Move(parameters, step);
    const NormalEquations at_next = Accumulate(points, next.F(), options.scale_px);
    const double gain = equations.cost - at_next.cost;
    if (gain > 0.0) {
      parameters = next;
      equations = at_next;
      lambda = std::max(0.1 * lambda, 1e-8);
      if (gain < options.min_relative_gain * equations.cost) break;
    } else {
      lambda *= 10.0;
      if (lambda > 1e6) break;
    }
  }
  report.F = parameters.F();
  report.cost = equations.cost;
  return report;
}

}  // namespace cairn
