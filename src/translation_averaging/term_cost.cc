#include "translation_averaging/term_cost.h"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

constexpr double kMinLength = 1e-12;

double Length(const Eigen::Vector3d& D) { return std::max(D.norm(), kMinLength); }

}  // namespace

double HuberCost(double residual, double scale) {
  return residual <= scale ? 0.5 * residual * residual : scale * (residual - 0.5 * scale);
}

double HuberWeight(double residual, double scale) {
  return residual <= scale ? 1.0 : scale / residual;
}

double ChordalCost(const Eigen::Vector3d& v, const Eigen::Vector3d& D, double huber) {
  return HuberCost((v - D / Length(D)).norm(), huber);
}

// With u = D / |D|: d(u)/dD = (I - u u') / |D|, so the gradient of |v - u|^2 / 2 is
// -(I - u u') v / |D|, and Gauss-Newton's curvature (I - u u') / |D|^2.
DirectionModel ChordalModel(const Eigen::Vector3d& v, const Eigen::Vector3d& D, double huber) {
  const double length = Length(D);
  const Eigen::Vector3d u = D / length;
  const double weight = HuberWeight((v - u).norm(), huber);
  return {std::sqrt(weight) / length * u, -weight / length * (v - u.dot(v) * u)};
}

}  // namespace cairn
