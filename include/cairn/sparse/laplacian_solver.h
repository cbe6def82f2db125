#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>
#include <utility>

namespace cairn {

// Solves L(w) X = B for the weighted Laplacian of a graph, L = sum_e w_e (e_i - e_j)(e_i - e_j)^T,
// with the gauge nodes held at zero (their rows and columns are removed): one gauge node in every
// connected component makes the system positive definite.
// The pattern is analyzed once (CHOLMOD, Chen et al. 2008, fill-reducing ordering; simplicial or
// supernodal by the predicted work), weights are refactored as often as needed, and all columns of
// B are solved together. Deterministic: BLAS runs on one thread.
class LaplacianSolver {
 public:
  // Nodes 0 .. num_nodes-1; edges may repeat and may be self-loops (ignored). is_gauge[node] tells
  // the nodes held at zero.
  LaplacianSolver(int num_nodes, std::span<const std::pair<int, int>> edges,
                  std::span<const char> is_gauge);
  ~LaplacianSolver();
  LaplacianSolver(const LaplacianSolver&) = delete;
  LaplacianSolver& operator=(const LaplacianSolver&) = delete;

  // Weights >= 0, one an edge; `diagonal`, if not empty, is added to the diagonal (one >= 0 value a
  // node: a pull towards zero). False if the matrix is not positive definite (weights leave a part
  // of the graph loose); then Solve must not be called.
  bool Factorize(std::span<const double> weights, std::span<const double> diagonal = {});

  // B and the result: num_nodes x k. Rows of gauge nodes are ignored in B and zero in the result.
  Eigen::MatrixXd Solve(const Eigen::MatrixXd& B) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cairn
