#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <vector>

namespace cairn {

// Quadratic model of a direction in the difference of its two positions: cost(delta + step) = cost
// + gradient' step + step' curvature step / 2, where the curvature is none along an axis and the
// square of the axis' length across it.
struct DirectionModel {
  Eigen::Vector3d axis;
  Eigen::Vector3d gradient;

  Eigen::Matrix3d Curvature() const {
    return axis.squaredNorm() * Eigen::Matrix3d::Identity() - axis * axis.transpose();
  }
  Eigen::Vector3d CurvatureTimes(const Eigen::Vector3d& x) const {
    return axis.squaredNorm() * x - axis.dot(x) * axis;
  }
};

// The same of a camera's own position.
struct CenterModel {
  Eigen::Matrix3d curvature;  // symmetric, positive semidefinite
  Eigen::Vector3d gradient;
};

// Of every term of a fit.
struct FitModels {
  std::vector<DirectionModel> edges;
  std::vector<DirectionModel> rays;
  std::vector<CenterModel> centers = {};  // one a camera; empty: none
};

// Positions of cameras (3 x n) and points (3 x number of tracks).
struct Positions {
  Eigen::Matrix3Xd cameras;
  Eigen::Matrix3Xd points;
};

// The edges and rays of one camera, increasing.
struct CameraTerms {
  struct Ray {
    int index;
    int track;
  };
  std::vector<int> edges;
  std::vector<Ray> rays;
};

// Points in the cameras' steps: inverse * (rhs + sum over rays of curvature * step of the camera).
struct EliminatedPoints {
  std::vector<Eigen::Matrix3d> inverse;  // of the damped sum of the rays' curvatures; symmetric
  Eigen::Matrix3Xd rhs;
};

// A block of the diagonal with damping, relative to its mean curvature: at least so much that the
// gauge (translation and scale) and loose nodes are solvable.
inline Eigen::Matrix3d Damped(const Eigen::Matrix3d& curvature, double damping) {
  constexpr double kMinDamping = 1e-9;
  const double mean = curvature.trace() / 3.0;
  return curvature +
         std::max(damping, kMinDamping) * (mean > 0 ? mean : 1.0) * Eigen::Matrix3d::Identity();
}

}  // namespace cairn
