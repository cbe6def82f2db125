#include "intrinsics/distorted_pair.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "cairn/base/check.h"
#include "cairn/geometry/epipolar.h"
#include "cairn/math/median.h"
#include "math/levenberg_marquardt.h"

namespace cairn::internal {

DistortedPair::DistortedPair(const DistortionPair& pair, const Camera& camera1,
                             const Camera& camera2)
    : camera_ids_{pair.camera_id1, pair.camera_id2},
      cameras_{camera1, camera2},
      pixels_{pair.pixels1, pair.pixels2} {
  CAIRN_CHECK_EQ(pair.pixels1.size(), pair.pixels2.size());
  for (int side = 0; side < 2; ++side) {
    is_free_[side] = CanCalibrateDistortion(cameras_[side]);
    Undistort(side);
  }
}

void DistortedPair::SetDistortion(double k1, double k2) {
  const double k[2] = {k1, k2};
  for (int side = 0; side < 2; ++side) {
    if (!is_free_[side]) continue;
    double& present = cameras_[side].params[cameras_[side].DistortionIndices()[0]];
    if (present == k[side]) continue;
    present = k[side];
    Undistort(side);
  }
}

void DistortedPair::Undistort(int side) {
  const Camera& camera = cameras_[side];
  const Eigen::Vector2d focal(camera.FocalX(), camera.FocalY());
  rays_[side].resize(pixels_[side].size());
  is_valid_[side].assign(pixels_[side].size(), 0);
  for (size_t i = 0; i < pixels_[side].size(); ++i) {
    Ray& ray = rays_[side][i];
    const auto x = camera.CamFromImg(pixels_[side][i], &ray.by_pixel);
    if (!x) continue;
    is_valid_[side][i] = 1;
    ray.x = x->homogeneous();
    // d = u (1 + k r^2) stays, so that u moves by -J^-1 u r^2, where J = (1 + k r^2) I + 2 k u u^T.
    const Eigen::Vector2d& u = *x;
    const double k = is_free_[side] ? camera.params[camera.DistortionIndices()[0]] : 0.0;
    ray.x_by_k = -ray.by_pixel * (u.squaredNorm() * focal.cwiseProduct(u));
    const Eigen::Vector2d& du = ray.x_by_k;
    const Eigen::Matrix2d J_by_k =
        (u.squaredNorm() + 2.0 * k * u.dot(du)) * Eigen::Matrix2d::Identity() +
        2.0 * u * u.transpose() + 2.0 * k * (du * u.transpose() + u * du.transpose());
    ray.by_pixel_by_k = -ray.by_pixel * focal.asDiagonal() * J_by_k * ray.by_pixel;
  }
}

void DistortedPair::Evaluate(const Eigen::Matrix3d& F) {
  errors_.assign(size(), 0.0);
  precisions_.assign(size(), 0.0);
  for (int i = 0; i < size(); ++i) {
    if (!is_valid_[0][i] || !is_valid_[1][i]) continue;
    const Ray &ray1 = rays_[0][i], &ray2 = rays_[1][i];
    const Eigen::Vector3d line2 = F * ray1.x, line1 = F.transpose() * ray2.x;
    const double squared = (ray2.by_pixel.transpose() * line2.head<2>()).squaredNorm() +
                           (ray1.by_pixel.transpose() * line1.head<2>()).squaredNorm();
    if (!(squared > 0.0)) continue;
    precisions_[i] = 1.0 / std::sqrt(squared);
    errors_[i] = ray2.x.dot(line2) * precisions_[i];
  }
}

// With C = x2^T F x1, lines l2 = F x1 and l1 = F^T x2, and M = d ray / d pixel, the error is
// C / sqrt(|M2^T l2|^2 + |M1^T l1|^2).
Eigen::Matrix<double, 9, 1> DistortedPair::ErrorByF(const Eigen::Matrix3d& F, int i,
                                                    Eigen::Vector2d* by_k) const {
  const Ray &ray1 = rays_[0][i], &ray2 = rays_[1][i];
  const Eigen::Vector2d line2 = (F * ray1.x).head<2>(), line1 = (F.transpose() * ray2.x).head<2>();
  const Eigen::Vector2d a1 = ray1.by_pixel.transpose() * line1;
  const Eigen::Vector2d a2 = ray2.by_pixel.transpose() * line2;
  const double precision = precisions_[i];
  const double ratio = errors_[i] * precision;  // C / squared length
  const Eigen::Vector2d b1 = ratio * ray1.by_pixel * a1, b2 = ratio * ray2.by_pixel * a2;
  Eigen::Matrix<double, 9, 1> by_F;
  const Eigen::Vector3d left = precision * (ray2.x - Eigen::Vector3d(b2.x(), b2.y(), 0.0));
  const Eigen::Vector3d right = precision * Eigen::Vector3d(b1.x(), b1.y(), 0.0);
  for (int column = 0; column < 3; ++column) {
    by_F.segment<3>(3 * column) = ray1.x[column] * left - right[column] * ray2.x;
  }
  if (by_k != nullptr) {
    const Eigen::Matrix2d corner = F.topLeftCorner<2, 2>();
    const Eigen::Vector2d &du1 = ray1.x_by_k, &du2 = ray2.x_by_k;
    *by_k = precision * Eigen::Vector2d(line1.dot(du1) - b2.dot(corner * du1) -
                                            ratio * a1.dot(ray1.by_pixel_by_k.transpose() * line1),
                                        line2.dot(du2) - b1.dot(corner.transpose() * du2) -
                                            ratio * a2.dot(ray2.by_pixel_by_k.transpose() * line2));
  }
  return by_F;
}

template <bool kWithDistortion>
auto DistortedPair::Linearize(const FundamentalFactors& F, double scale_px) {
  constexpr int kColumns = kWithDistortion ? 11 : 9;
  const double s2 = scale_px * scale_px;
  const Eigen::Matrix3d matrix = F.F();
  NormalEquations<kColumns> sums;
  Evaluate(matrix);
  for (int i = 0; i < size(); ++i) {
    if (!(precisions_[i] > 0.0)) {
      sums.cost += 1.0;
      continue;
    }
    // Of Geman and McClure's loss e^2 / (s^2 + e^2), by e^2.
    const double weight = s2 / (s2 + errors_[i] * errors_[i]);
    sums.cost += 1.0 - weight;
    typename NormalEquations<kColumns>::Vector row;
    Eigen::Vector2d by_k;
    row.template head<9>() = ErrorByF(matrix, i, kWithDistortion ? &by_k : nullptr);
    if constexpr (kWithDistortion) row.template tail<2>() = by_k;
    sums.Add(errors_[i], row, weight * weight / s2);
  }
  constexpr int kRest = kColumns - 9;
  constexpr int kDof = FundamentalFactors::kDof;
  Eigen::Matrix<double, kColumns, kDof + kRest> directions;
  directions.setZero();
  directions.template topLeftCorner<9, kDof>() = F.ByStep();
  for (int k = 0; k < kRest; ++k) directions(9 + k, kDof + k) = 1.0;
  return sums.template Along<kDof + kRest>(directions);
}

double DistortedPair::Refine(double scale_px, int max_iterations, FundamentalFactors* F) {
  struct Problem {
    using State = FundamentalFactors;
    auto Linearize(const State& at) { return pair.Linearize<false>(at, scale_px); }
    State Moved(const State& from, const State::Step& step) const { return from.Moved(step); }
    DistortedPair& pair;
    double scale_px;
  } problem{*this, scale_px};
  return Minimize(problem, {.max_iterations = max_iterations}, F).cost;
}

NormalEquations<2> DistortedPair::Reduce(const FundamentalFactors& F, double scale_px) {
  constexpr int kDof = FundamentalFactors::kDof;
  using Vector = FundamentalFactors::Step;
  const NormalEquations<kDof + 2> all = Linearize<true>(F, scale_px);
  Eigen::Matrix<double, kDof, kDof> H = all.hessian.topLeftCorner<kDof, kDof>();
  // Directions of F that no match sees.
  H.diagonal().array() += 1e-9 * H.trace();
  NormalEquations<2> reduced;
  reduced.cost = all.cost;
  reduced.hessian = all.hessian.bottomRightCorner<2, 2>();
  reduced.hessian(0, 1) = reduced.hessian(1, 0);
  reduced.gradient = all.gradient.tail<2>();
  const Eigen::Matrix<double, 2, kDof> mixed = all.hessian.bottomLeftCorner<2, kDof>();
  Vector along;
  if (SolvePositive<kDof>(H, all.gradient.head<kDof>(), &along)) reduced.gradient -= mixed * along;
  for (int k = 0; k < 2; ++k) {
    if (SolvePositive<kDof>(H, mixed.row(k).transpose(), &along)) {
      reduced.hessian.col(k) -= mixed * along;
    }
  }
  return reduced;
}

double DistortedPair::NoisePx(const FundamentalFactors& F, double max_sigma_px) {
  constexpr int kRounds = 3;
  Evaluate(F.F());
  double sigma = max_sigma_px;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> lengths;
    for (int i = 0; i < size(); ++i) {
      if (precisions_[i] > 0.0 && std::abs(errors_[i]) < 3.0 * sigma) {
        lengths.push_back(std::abs(errors_[i]));
      }
    }
    sigma = std::clamp(UpperMedian(std::move(lengths)) / kNormalMedian, kMinSigmaPx, sigma);
  }
  return sigma;
}

int DistortedPair::NumExplained(const FundamentalFactors& F, double max_error_px) {
  Evaluate(F.F());
  int num = 0;
  for (int i = 0; i < size(); ++i) {
    num += precisions_[i] > 0.0 && std::abs(errors_[i]) < max_error_px;
  }
  return num;
}

FocalPair DistortedPair::Explained(const FundamentalFactors& F, double max_error_px, int max_num) {
  FocalPair pair;
  pair.camera_id1 = camera_ids_[0];
  pair.camera_id2 = camera_ids_[1];
  const Eigen::Matrix3d K1 = cameras_[0].CalibrationMatrix(), K2 = cameras_[1].CalibrationMatrix();
  pair.F = FundamentalFromEssential(F.F(), K1, K2);
  const int num = NumExplained(F, max_error_px);
  if (num < kMinFundamentalMatches) return pair;
  const int step = 1 + (num - 1) / max_num;
  for (int i = 0, seen = 0; i < size(); ++i) {
    if (!(precisions_[i] > 0.0) || !(std::abs(errors_[i]) < max_error_px)) continue;
    if (seen++ % step != 0) continue;
    pair.pixels1.emplace_back((K1 * rays_[0][i].x).head<2>());
    pair.pixels2.emplace_back((K2 * rays_[1][i].x).head<2>());
  }
  return pair;
}

}  // namespace cairn::internal
