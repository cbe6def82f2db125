#include "resection/pose_refinement.h"

#include <array>
#include <cmath>
#include <limits>

#include "cairn/math/so3.h"
#include "math/levenberg_marquardt.h"

namespace cairn {
namespace {

double RobustCost(double squared, double squared_scale) {
  return squared_scale * std::log1p(squared / squared_scale);
}

// Over (rotation about the camera, translation, logarithm of the focal factor): about the world's
// origin, which may be far away, hardly anything would turn but what moves as well. Points without
// a pixel cost infinitely much.
struct PoseProblem {
  struct State {
    Camera camera;
    Rigid3d cam_from_world;
  };

  NormalEquations<7> Linearize(const State& at) const;
  State Moved(const State& from, const NormalEquations<7>::Vector& step) const;

  const PixelsOfPoints& points;
  std::span<const int> indices;
  bool refine_focal;
  double squared_scale;
};

NormalEquations<7> PoseProblem::Linearize(const State& at) const {
  const auto& [camera, pose] = at;
  NormalEquations<7> sums;
  const std::vector<int> focal_indices = refine_focal ? camera.FocalIndices() : std::vector<int>();
  const auto num_params = static_cast<int>(camera.params.size());
  std::array<double, 2 * kMaxCameraParams> J_params;
  for (const int i : indices) {
    const Eigen::Vector3d x = pose * points.xyz[i];
    Eigen::Vector2d pixel;
    Eigen::Matrix<double, 2, 3, Eigen::RowMajor> J_x;
    const CameraParams params = {camera.model, camera.params.data()};
    if (!ImgFromRay(params, x.data(), pixel.data(), J_x.data(), J_params.data())) {
      sums.cost = std::numeric_limits<double>::infinity();
      return sums;
    }
    const Eigen::Vector2d residual = PixelDifference(params, pixel, points.pixels[i]);
    const double squared = residual.squaredNorm();
    sums.cost += RobustCost(squared, squared_scale);
    const double weight = 1.0 / (1.0 + squared / squared_scale);
    const Eigen::Matrix<double, 2, 3> by_rotation = -J_x * CrossMatrix(x);
    for (int row = 0; row < 2; ++row) {
      double by_focal = 0.0;
      for (const int k : focal_indices) {
        by_focal += camera.params[k] * J_params[row * num_params + k];
      }
      NormalEquations<7>::Vector J;
      J << by_rotation.row(row).transpose(), J_x.row(row).transpose(), by_focal;
      sums.Add(residual[row], J, weight);
    }
  }
  return sums;
}

PoseProblem::State PoseProblem::Moved(const State& from,
                                      const NormalEquations<7>::Vector& step) const {
  State to = from;
  Rigid3d& pose = to.cam_from_world;
  const Eigen::Quaterniond turn = ExpSO3(step.head<3>());
  pose.rotation = (turn * pose.rotation).normalized();
  pose.translation = turn * pose.translation + step.segment<3>(3);
  if (refine_focal) to.camera.SetMeanFocal(from.camera.MeanFocal() * std::exp(step[6]));
  return to;
}

}  // namespace

int RefinePose(const PixelsOfPoints& points, std::span<const int> indices,
               const AbsolutePoseRefinementOptions& options, Camera& camera,
               Rigid3d& cam_from_world) {
  PoseProblem problem{points, indices, options.refine_focal,
                      options.loss_scale_px * options.loss_scale_px};
  PoseProblem::State state{camera, cam_from_world};
  const auto report = Minimize(problem, {options.max_iterations, 1e-9}, &state);
  camera = std::move(state.camera);
  cam_from_world = state.cam_from_world;
  return report.num_accepted;
}

}  // namespace cairn
