#include "georegistration/open_heights.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "cairn/evaluation/alignment.h"
#include "cairn/evaluation/error_statistics.h"
#include "cairn/math/decompositions.h"
#include "cairn/math/so3.h"
#include "math/levenberg_marquardt.h"

namespace cairn {
namespace {

using Points = std::vector<Eigen::Vector3d>;

// The two similarities that put three points exactly to places on the plane: the triangle's own
// plane is scaled by M; the larger singular value is the scale, and what the smaller one lacks of
// it is the tilt. None for points on a line.
std::vector<Sim3d> AlignTriple(const std::array<Eigen::Vector3d, 3>& src,
                               const std::array<Eigen::Vector3d, 3>& dst) {
  Eigen::Matrix3d axes;  // of the triangle; the third is its normal
  const Eigen::Vector3d side1 = src[1] - src[0], side2 = src[2] - src[0];
  axes.col(0) = side1.normalized();
  axes.col(2) = side1.cross(side2).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  Eigen::Matrix2d in_plane, moved;
  in_plane << axes.leftCols<2>().transpose() * side1, axes.leftCols<2>().transpose() * side2;
  moved << (dst[1] - dst[0]).head<2>(), (dst[2] - dst[0]).head<2>();
  const Eigen::Matrix2d M = moved * in_plane.inverse();
  if (!M.allFinite()) return {};
  const EigenPairs<2> squared = SymmetricEigen<2>(M.transpose() * M);
  if (!(squared.values[1] > 0)) return {};
  const double scale = std::sqrt(squared.values[1]);
  const double sine = std::sqrt(std::max(0.0, 1 - squared.values[0] / squared.values[1]));
  std::vector<Sim3d> found;
  for (const double sign : {1.0, -1.0}) {
    Eigen::Matrix3d to;  // where the axes go
    to.topLeftCorner<2, 2>() = M / scale;
    to.bottomLeftCorner<1, 2>() = sign * sine * squared.vectors.col(0).transpose();
    to.col(2) = to.col(0).cross(to.col(1));
    Sim3d& sim = found.emplace_back();
    sim.scale = scale;
    sim.rotation = Eigen::Quaterniond(Eigen::Matrix3d(to * axes.transpose())).normalized();
    sim.translation = dst[0] - scale * (sim.rotation * src[0]);
  }
  return found;
}

double MedianHorizontally(const Sim3d& dst_from_src, const Points& src, const Points& dst) {
  std::vector<double> residuals;
  for (size_t i = 0; i < src.size(); ++i) {
    residuals.push_back((dst_from_src * src[i] - dst[i]).head<2>().norm());
  }
  return Median(std::move(residuals));
}

// Over (rotation, logarithm of the scale) of points about their means.
struct HorizontalProblem {
  using State = Sim3d;

  NormalEquations<4> Linearize(const State& at) const {
    NormalEquations<4> sums;
    for (size_t i = 0; i < src.size(); ++i) {
      const Eigen::Vector3d moved = at.scale * (at.rotation * src[i]);
      const Eigen::Matrix3d by_rotation = -CrossMatrix(moved);
      for (int k = 0; k < 2; ++k) {
        const double residual = moved[k] - dst[i][k];
        sums.cost += weights[i] * residual * residual;
        sums.Add(residual, {by_rotation(k, 0), by_rotation(k, 1), by_rotation(k, 2), moved[k]},
                 weights[i]);
      }
    }
    return sums;
  }
  State Moved(const State& from, const NormalEquations<4>::Vector& step) const {
    State to = from;
    to.rotation = (ExpSO3(step.head<3>()) * from.rotation).normalized();
    to.scale = from.scale * std::exp(step[3]);
    return to;
  }

  Points src, dst;
  const std::vector<double>& weights;
};

// Moves the points to their weighted mean, which is returned.
Eigen::Vector3d Center(const std::vector<double>& weights, Points& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double total = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    mean += weights[i] * points[i];
    total += weights[i];
  }
  mean /= total;
  for (Eigen::Vector3d& point : points) point -= mean;
  return mean;
}

}  // namespace

std::optional<Sim3d> AlignHorizontallyRobust(const Points& src, const Points& dst, uint64_t seed) {
  std::optional<Sim3d> best;
  double least_median = std::numeric_limits<double>::infinity();
  for (const auto& [i, j, k] : SampleTriples(static_cast<uint32_t>(src.size()), seed)) {
    for (const Sim3d& sim : AlignTriple({src[i], src[j], src[k]}, {dst[i], dst[j], dst[k]})) {
      const double median = MedianHorizontally(sim, src, dst);
      if (!(median < least_median)) continue;
      least_median = median;
      best = sim;
    }
  }
  return best;
}

Sim3d AlignHorizontally(const Points& src, const Points& dst, const std::vector<double>& weights,
                        Sim3d dst_from_src) {
  HorizontalProblem problem{src, dst, weights};
  const Eigen::Vector3d mean_src = Center(weights, problem.src);
  Eigen::Vector3d mean_dst = Center(weights, problem.dst);
  mean_dst.z() = 0;
  Minimize(problem, {.min_relative_gain = 1e-9}, &dst_from_src);
  dst_from_src.translation = mean_dst - dst_from_src.scale * (dst_from_src.rotation * mean_src);
  return dst_from_src;
}

double OffLevel(const Reconstruction& model, const Eigen::Quaterniond& enu_from_world) {
  const Eigen::Vector3d up_in_world = enu_from_world.conjugate() * Eigen::Vector3d::UnitZ();
  double sum = 0;
  for (const auto& [id, image] : model.images) {
    const Eigen::Vector3d up = image.cam_from_world.rotation * up_in_world;
    sum += std::min(up.x() * up.x(), up.y() * up.y());
  }
  return sum / static_cast<double>(model.images.size());
}

}  // namespace cairn
