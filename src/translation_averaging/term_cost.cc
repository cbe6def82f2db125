#include "translation_averaging/term_cost.h"

#include <algorithm>
#include <cmath>

namespace cairn {
namespace {

constexpr double kMinLength = 1e-12;
// A scale is at least this share of 1 / |D|: at zero a term would stop to pull.
constexpr double kMinRelativeScale = 1e-3;

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
TermModel ChordalModel(const Eigen::Vector3d& v, const Eigen::Vector3d& D, double huber) {
  const double length = Length(D);
  const Eigen::Vector3d u = D / length;
  const double weight = HuberWeight((v - u).norm(), huber);
  return {weight / (length * length) * (Eigen::Matrix3d::Identity() - u * u.transpose()),
          -weight / length * (v - u.dot(v) * u)};
}

double ScaleFreeCost(const Eigen::Vector3d& v, const Eigen::Vector3d& D, double s, double huber) {
  return HuberCost((v - s * D).norm(), huber);
}

// The Gauss-Newton system of (D, s), whose block of s is |D|^2 (1 + damping), with s eliminated.
TermModel ScaleFreeModel(const Eigen::Vector3d& v, const Eigen::Vector3d& D, double s, double huber,
                         double damping) {
  const Eigen::Vector3d r = v - s * D;
  const double weight = HuberWeight(r.norm(), huber);
  const double pivot = Length(D) * Length(D) * (1 + damping);
  return {weight * s * s * (Eigen::Matrix3d::Identity() - D * D.transpose() / pivot),
          -weight * s * (r - D * (D.dot(r) / pivot))};
}

double ScaleFreeUpdate(const Eigen::Vector3d& v, const Eigen::Vector3d& D, double s,
                       const Eigen::Vector3d& step, double damping) {
  const Eigen::Vector3d r = v - s * D;
  const double pivot = Length(D) * Length(D) * (1 + damping);
  const double moved = s + (D.dot(r) - s * D.dot(step)) / pivot;
  return std::max(moved, kMinRelativeScale / Length(D + step));
}

double BestScale(const Eigen::Vector3d& v, const Eigen::Vector3d& D) {
  const double length = Length(D);
  return std::max(D.dot(v) / length, kMinRelativeScale) / length;
}

}  // namespace cairn
