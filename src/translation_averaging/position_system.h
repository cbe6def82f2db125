#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <memory>
#include <vector>

#include "sparse/block_cholesky.h"
#include "translation_averaging/direction_problem.h"

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

// The linear systems of a fit of cameras and points whose terms are functions of c2 - c1 (edges),
// X - c (rays) and c (centers). Points are eliminated first (Schur complement), the cameras' system
// is solved by sparse Cholesky with a pattern analyzed once. Where the factor would be too
// expensive, by conjugate gradients, without forming that system: time and memory grow with the
// numbers of edges and rays, not with the pairs that a point joins. Their preconditioner has two
// levels: the diagonal blocks, and the system of groups of cameras that move as one (Nicolaides,
// "Deflation of conjugate gradients with applications to boundary value problems", 1987).
class PositionSystem {
 public:
  // Beyond max_cholesky_flops a factorization takes longer than a few hundred iterations.
  PositionSystem(const DirectionProblem& problem, int num_threads,
                 double max_cholesky_flops = 2e10);

  // The step that minimizes the sum of all models plus damping times half the squared step, weighed
  // at every node with the mean curvature there. False if the system is singular.
  // positions: where the cameras are now, more or less; those near each other make a group.
  bool Solve(const FitModels& models, double damping, const Eigen::Matrix3Xd& positions,
             Positions& step);

  bool UsesCholesky() const { return cholesky_ != nullptr; }
  // Less damping changes nothing that matters, but costs conjugate gradients many iterations.
  double MinDamping() const { return UsesCholesky() ? 1e-9 : 1e-5; }

 private:
  void BuildPattern();
  void BuildCholesky(double max_flops);
  void EliminatePoints(const FitModels& models, double damping);
  void AssembleDiagonal(int camera, const FitModels& models, double damping);
  void AssembleRow(int camera, const FitModels& models, std::vector<Eigen::Matrix3d>& scratch);
  bool SolveByCholesky(const FitModels& models, Eigen::Matrix3Xd& step);
  void SolveByConjugateGradients(Eigen::Matrix3Xd& step) const;
  void BuildCouplings(const FitModels& models);
  // Of the diagonal blocks, and of groups.
  void MakePreconditioner(const FitModels& models);
  void AddToGroups(const FitModels& models, int part, Eigen::MatrixXd& system) const;
  Eigen::Matrix3Xd Precondition(const Eigen::Matrix3Xd& residual) const;
  Eigen::Matrix3Xd Multiply(const Eigen::Matrix3Xd& x) const;

  const DirectionProblem& problem_;
  int num_threads_;
  std::vector<std::vector<int>> edges_of_;  // of each camera
  std::vector<std::vector<int>> rays_of_;
  std::vector<int> track_of_ray_;
  // Upper triangle of the reduced system by rows of blocks: row i holds column_[k] for k in
  // [row_begin_[i], row_begin_[i + 1]), increasing, the first one i itself.
  std::vector<int> row_begin_;
  std::vector<int> column_;
  std::vector<Eigen::Matrix3d> blocks_;
  std::vector<Eigen::Matrix3d> damped_;    // diagonal block of each camera before points are out
  std::vector<Eigen::Matrix3d> diagonal_;  // and after
  std::vector<Eigen::Matrix3d> diagonal_inverse_;
  // For conjugate gradients: the axes in the order in which they are read, half as large; a step is
  // not that exact.
  struct Coupling {
    float x, y, z;
    int other;
  };
  std::vector<Coupling> edges_by_camera_, rays_by_camera_, rays_by_track_;
  std::vector<size_t> edges_begin_, rays_begin_;  // of each camera
  std::vector<int> group_of_;                     // of each camera
  int num_groups_ = 0;
  Eigen::LLT<Eigen::MatrixXd> groups_;
  Eigen::Matrix3Xd rhs_;
  std::vector<Eigen::Matrix3d> point_inverse_;
  Eigen::Matrix3Xd point_rhs_;
  std::unique_ptr<BlockCholesky> cholesky_;  // null: conjugate gradients
};

}  // namespace cairn
