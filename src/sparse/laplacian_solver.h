#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <memory>
#include <span>
#include <vector>

#include "graph/graph.h"
#include "sparse/sparse_cholesky.h"

namespace cairn {

// Solves L(w) X = B for the weighted Laplacian of a graph, L = sum_e w_e (e_i - e_j)(e_i - e_j)^T,
// with the gauge nodes held at zero (their rows and columns are removed): one gauge node in every
// connected component makes the system positive definite for positive weights.
// The pattern is analyzed once, weights are refactored as often as needed, and all columns of B are
// solved together: n x n instead of the 3n x 3n of three coordinates. Where a factorization would
// take more operations than max_cholesky_steps of conjugate gradients for three columns, these are
// taken instead. Their preconditioner has two levels: the diagonal, and the system of aggregates of
// nodes that move as one (Nicolaides, "Deflation of conjugate gradients with applications to
// boundary value problems", 1987), without which they need ever more iterations the farther a graph
// reaches.
class LaplacianSolver {
 public:
  // Nodes 0 .. num_nodes-1; edges may repeat, and join two different nodes. is_gauge[node] tells
  // the nodes held at zero.
  LaplacianSolver(int num_nodes, std::span<const GraphEdge> edges, std::span<const char> is_gauge,
                  int num_threads = 1, int max_cholesky_steps = 200);

  // Weights >= 0, one an edge. False if the matrix is not positive definite (weights of zero leave
  // a part of the graph loose); then Solve must not be called.
  bool Factorize(std::span<const double> weights);

  // B and the result: num_nodes x k. Rows of gauge nodes are ignored in B and zero in the result.
  // Conjugate gradients begin at `guess`, unless it is empty, and end when the error is this share
  // of the solution (in the norm that they minimize); one that is near saves most of the
  // iterations.
  Eigen::MatrixXd Solve(const Eigen::MatrixXd& B, const Eigen::MatrixXd& guess = {},
                        double tolerance = 1e-4) const;

  bool UsesCholesky() const { return factor_ != nullptr; }

 private:
  // Of an edge's ends; -1: gauge.
  struct RowPair {
    int row1;
    int row2;
  };
  struct Neighbor {
    int row;
    int edge;
  };
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  void FindEntries(const SymmetricPattern& pattern);
  void BuildNeighbors();
  void FindAggregates();
  void FactorizeAggregates();
  Rows Multiply(const Rows& X) const;
  template <int kColumns>
  void AddNeighbors(const Rows& X, Rows& Y) const;
  Rows Precondition(const Rows& residual) const;
  Rows RowsOf(const Eigen::MatrixXd& of_nodes) const;
  Rows SolveByConjugateGradients(const Rows& B, Rows X, double tolerance) const;

  int num_nodes_;
  int num_threads_;
  std::vector<int> row_of_node_;  // -1: gauge
  std::vector<RowPair> rows_of_edge_;
  std::vector<int64_t> diagonal_of_row_;
  Eigen::VectorXd diagonal_;
  std::unique_ptr<SparseCholesky> factor_;  // null: conjugate gradients
  // Of the factorization's matrix.
  std::vector<int64_t> entry_of_edge_;  // off the diagonal; -1: none
  std::vector<double> values_;
  // Of conjugate gradients.
  std::vector<int64_t> neighbors_begin_;  // of each row
  std::vector<Neighbor> neighbors_;
  std::vector<double> neighbor_weights_;
  std::vector<int> aggregate_of_row_;
  int num_aggregates_ = 0;
  Eigen::LDLT<Eigen::MatrixXd> aggregates_;  // system of the aggregates, each as one
};

}  // namespace cairn
