#include "robust/fundamental_refinement.h"

#include <Eigen/Geometry>
#include <cmath>

#include "cairn/base/check.h"
#include "math/levenberg_marquardt.h"

namespace cairn {
namespace {

struct FundamentalProblem {
  using State = FundamentalFactors;

  NormalEquations<State::kDof> Linearize(const State& at) const {
    return LinearizeFundamental(points, at.F(), scale_px).Along<State::kDof>(at.ByStep());
  }
  State Moved(const State& from, const State::Step& step) const { return from.Moved(step); }

  const PointPairs& points;
  double scale_px;
};

}  // namespace

NormalEquations<9> LinearizeFundamental(const PointPairs& points, const Eigen::Matrix3d& F,
                                        double scale_px, int begin, int step) {
  NormalEquations<9> sums;
  const double w1 = 1.0 / (points.focal1_px() * points.focal1_px());
  const double w2 = 1.0 / (points.focal2_px() * points.focal2_px());
  const double squared_scale = scale_px * scale_px;
  for (int i = begin; i < points.size(); i += step) {
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
    Eigen::Matrix<double, 9, 1> J;
    for (int column = 0; column < 3; ++column) {
      J.segment<3>(3 * column) = left * x1[column] + x2 * right[column];
    }
    sums.Add(error, J, weight * weight / squared_scale);
  }
  return sums;
}

FundamentalFactors RefineFundamentalMatrix(const PointPairs& points, const Eigen::Matrix3d& start,
                                           const FundamentalRefinementOptions& options) {
  std::optional<FundamentalFactors> factors = FundamentalFactors::Of(start);
  CAIRN_CHECK(factors.has_value());
  FundamentalProblem problem{points, options.scale_px};
  Minimize(problem, {options.max_iterations, options.min_relative_gain}, &*factors);
  return *factors;
}

}  // namespace cairn
