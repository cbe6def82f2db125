#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "sparse/block_cholesky.h"
#include "translation_averaging/direction_problem.h"
#include "translation_averaging/iterative_cameras.h"
#include "translation_averaging/position_models.h"

namespace cairn {

// The linear systems of a fit of cameras and points whose terms are functions of c2 - c1 (edges),
// X - c (rays) and c (centers). Points are eliminated first (Schur complement), the cameras' system
// is solved by sparse Cholesky with a pattern analyzed once, or by conjugate gradients where the
// factor would be too expensive.
class PositionSystem {
 public:
  // Factorizes where that takes no more operations than max_cholesky_steps of conjugate gradients.
  PositionSystem(const DirectionProblem& problem, int num_threads, int max_cholesky_steps = 200);

  // Before the first Solve, and before one with other models than the last. positions: where the
  // cameras are now, more or less.
  void Restart(const Eigen::Matrix3Xd& positions);
  // The step that minimizes the sum of all models plus damping times half the squared step, weighed
  // at every node with the mean curvature there. False if the system is singular.
  bool Solve(const FitModels& models, double damping, Positions& step);

  bool UsesCholesky() const { return cholesky_ != nullptr; }
  // Less damping changes nothing that matters, but costs conjugate gradients many iterations.
  double MinDamping() const { return UsesCholesky() ? 1e-9 : 1e-5; }

 private:
  void EliminatePoints(const FitModels& models, double damping);
  void AssembleDiagonal(int camera, const FitModels& models, double damping);
  void AssembleRow(int camera, const FitModels& models, std::vector<Eigen::Matrix3d>& scratch);
  bool SolveByCholesky(const FitModels& models, double damping, Eigen::Matrix3Xd& step);

  const DirectionProblem& problem_;
  int num_threads_;
  std::vector<CameraTerms> terms_of_;  // each camera
  EliminatedPoints points_;
  // Of the blocks in each row of the reduced system's upper triangle, increasing, the first one the
  // diagonal's.
  std::vector<std::vector<int>> columns_;
  std::vector<Eigen::Matrix3d> diagonal_;
  Eigen::Matrix3Xd rhs_;
  std::unique_ptr<BlockCholesky> cholesky_;      // null: conjugate gradients
  std::unique_ptr<IterativeCameras> iterative_;  // null: Cholesky
};

}  // namespace cairn
