#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cstdint>
#include <utility>
#include <vector>

#include "translation_averaging/direction_problem.h"
#include "translation_averaging/position_models.h"

namespace cairn {

// Solves the cameras' system, out of which the points are eliminated, by conjugate gradients and
// without forming it: time and memory grow with the numbers of edges and rays, not with the pairs
// that a point joins. The preconditioner has two levels: the diagonal blocks, and the system of
// groups of cameras that move as one (Nicolaides, "Deflation of conjugate gradients with
// applications to boundary value problems", 1987).
class IterativeCameras {
 public:
  IterativeCameras(const DirectionProblem& problem, int num_threads);

  // Before the first Solve, and before one with other models than the last. positions: where the
  // cameras are now, more or less; those near each other make a group, once and for all.
  void Restart(const Eigen::Matrix3Xd& positions);
  // The step of the cameras (3 x n), nearly. Where the models are those of the last step, the
  // system of groups is, too, though the damping differs: a preconditioner need not be exact.
  Eigen::Matrix3Xd Solve(const FitModels& models, const EliminatedPoints& points, double damping);

 private:
  // What a part of the edges and tracks adds to a camera's block of the diagonal and right side.
  struct Diagonal {
    Eigen::Matrix3d own = Eigen::Matrix3d::Zero();
    Eigen::Matrix3d fill = Eigen::Matrix3d::Zero();  // by the points eliminated; subtracted
    Eigen::Vector3d rhs = Eigen::Vector3d::Zero();
  };
  void Assemble(const FitModels& models, const EliminatedPoints& points, double damping);
  void AssemblePart(int64_t part, const FitModels& models, const EliminatedPoints& points,
                    std::vector<Diagonal>& diagonal);
  void AddToGroups(int64_t part, const FitModels& models, const EliminatedPoints& points,
                   std::vector<Eigen::Matrix3d>& blocks) const;
  void FactorizeGroups(const FitModels& models, const EliminatedPoints& points);
  Eigen::Matrix3Xd Iterate(const EliminatedPoints& points) const;
  Eigen::Matrix3Xd Precondition(const Eigen::Matrix3Xd& residual) const;
  Eigen::Matrix3Xd Multiply(const EliminatedPoints& points, const Eigen::Matrix3Xd& x) const;
  void MultiplyPart(int64_t part, const EliminatedPoints& points, const Eigen::Vector4d* x,
                    Eigen::Vector4d* sums) const;

  const DirectionProblem& problem_;
  int num_threads_;
  // What a product reads of the problem and the models, and no more, since reading takes most of
  // its time. Axes (x, y, z and the squared length) are in single precision: a step is not that
  // exact.
  std::vector<Eigen::Vector4f> edge_axes_, ray_axes_;
  std::vector<std::pair<int, int>> edge_cameras_;
  std::vector<int> ray_cameras_;
  std::vector<Eigen::Matrix3d> damped_;  // diagonal block of each camera before points are out
  std::vector<Eigen::Matrix3d> diagonal_inverse_;  // and the inverse of that after
  Eigen::Matrix3Xd rhs_;
  std::vector<int> group_of_;  // of each camera
  int num_groups_ = 0;
  Eigen::LLT<Eigen::MatrixXd> groups_;
  bool has_groups_ = false;  // of these models
};

}  // namespace cairn
