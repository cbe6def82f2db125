#include "resection/pose_refinement.h"

#include <Eigen/Cholesky>
#include <array>
#include <cmath>
#include <limits>

#include "cairn/math/so3.h"

namespace cairn {
namespace {

using Matrix7d = Eigen::Matrix<double, 7, 7>;
using Vector7d = Eigen::Matrix<double, 7, 1>;

struct Observations {
  std::span<const Eigen::Vector2d> pixels;
  std::span<const Eigen::Vector3d> xyz;
  std::span<const int> indices;
  double squared_scale;
};

double RobustCost(double squared, double squared_scale) {
  return squared_scale * std::log1p(squared / squared_scale);
}

// Infinite if a point has no pixel.
double Cost(const Observations& obs, const Camera& camera, const Rigid3d& pose) {
  double cost = 0;
  for (const int i : obs.indices) {
    const auto pixel = camera.ImgFromRay(pose * obs.xyz[i]);
    if (!pixel) return std::numeric_limits<double>::infinity();
    const double squared = (*pixel - obs.pixels[i]).squaredNorm();
    cost += RobustCost(squared, obs.squared_scale);
  }
  return cost;
}

// Normal equations in (left rotation, translation, logarithm of the focal factor).
void Linearize(const Observations& obs, const Camera& camera, const Rigid3d& pose, Matrix7d* JtJ,
               Vector7d* Jtr) {
  JtJ->setZero();
  Jtr->setZero();
  const std::vector<int> focal_indices = camera.FocalIndices();
  const auto num_params = static_cast<int>(camera.params.size());
  std::array<double, 2 * kMaxCameraParams> J_params;
  for (const int i : obs.indices) {
    const Eigen::Vector3d rotated = pose.rotation * obs.xyz[i];
    const Eigen::Vector3d x = rotated + pose.translation;
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> J_x;
    ImgFromRay(camera.model, camera.params.data(), x.data(), pixel.data(), J_x.data(),
               J_params.data());
    const Eigen::Vector2d residual = pixel - obs.pixels[i];
    Eigen::Matrix<double, 2, 7> J;
    J.leftCols<3>() = -J_x * CrossMatrix(rotated);
    J.middleCols<3>(3) = J_x;
    J.col(6).setZero();
    for (const int k : focal_indices) {
      for (int row = 0; row < 2; ++row) {
        J(row, 6) += camera.params[k] * J_params[row * num_params + k];
      }
    }
    const double weight = 1.0 / (1.0 + residual.squaredNorm() / obs.squared_scale);
    JtJ->noalias() += weight * J.transpose() * J;
    Jtr->noalias() += weight * J.transpose() * residual;
  }
}

}  // namespace

int RefinePose(std::span<const Eigen::Vector2d> pixels, std::span<const Eigen::Vector3d> xyz,
               std::span<const int> indices, bool refine_focal, double loss_scale_px,
               int max_iterations, Camera& camera, Rigid3d& cam_from_world) {
  const Observations obs{pixels, xyz, indices, loss_scale_px * loss_scale_px};
  double cost = Cost(obs, camera, cam_from_world);
  if (!std::isfinite(cost)) return 0;
  double damping = 1e-4;
  int num_accepted = 0;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    Matrix7d JtJ;
    Vector7d Jtr;
    Linearize(obs, camera, cam_from_world, &JtJ, &Jtr);
    if (!refine_focal) {
      JtJ.row(6).setZero();
      JtJ.col(6).setZero();
      JtJ(6, 6) = 1.0;
      Jtr[6] = 0.0;
    }
    bool accepted = false;
    double gain = 0;
    for (int attempt = 0; attempt < 8 && !accepted; ++attempt) {
      Matrix7d damped = JtJ;
      damped.diagonal() += damping * JtJ.diagonal();
      const Vector7d delta = damped.ldlt().solve(-Jtr);
      Rigid3d pose = cam_from_world;
      pose.rotation = (ExpSO3(delta.head<3>()) * pose.rotation).normalized();
      pose.translation += delta.segment<3>(3);
      Camera candidate = camera;
      if (refine_focal) candidate.SetMeanFocal(camera.MeanFocal() * std::exp(delta[6]));
      const double candidate_cost = Cost(obs, candidate, pose);
      accepted = candidate_cost < cost;
      damping = accepted ? std::max(0.1 * damping, 1e-12) : 10.0 * damping;
      if (!accepted) continue;
      gain = (cost - candidate_cost) / cost;
      cost = candidate_cost;
      cam_from_world = pose;
      camera = std::move(candidate);
    }
    if (!accepted) break;
    ++num_accepted;
    if (gain < 1e-9) break;
  }
  return num_accepted;
}

}  // namespace cairn
