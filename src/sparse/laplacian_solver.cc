#include "sparse/laplacian_solver.h"

#include <algorithm>

#include "cairn/base/check.h"

namespace cairn {

LaplacianSolver::LaplacianSolver(int num_nodes, std::span<const Edge> edges,
                                 std::span<const char> is_gauge)
    : num_nodes_(num_nodes), row_of_node_(num_nodes, -1), edges_(edges.begin(), edges.end()) {
  CAIRN_CHECK_EQ(is_gauge.size(), static_cast<size_t>(num_nodes));
  int num_rows = 0;
  for (int v = 0; v < num_nodes; ++v) {
    if (!is_gauge[v]) row_of_node_[v] = num_rows++;
  }

  std::vector<std::vector<int64_t>> columns(num_rows);
  for (int r = 0; r < num_rows; ++r) columns[r].push_back(r);
  const auto rows_of = [&](const Edge& edge) {
    return std::minmax(row_of_node_[edge.node1], row_of_node_[edge.node2]);
  };
  for (const Edge& edge : edges_) {
    const auto [low, high] = rows_of(edge);
    if (low >= 0 && low != high) columns[low].push_back(high);
  }
  SymmetricPattern pattern;
  for (std::vector<int64_t>& column : columns) {
    std::sort(column.begin(), column.end());
    column.erase(std::unique(column.begin(), column.end()), column.end());
    diagonal_of_row_.push_back(pattern.begin.back());
    pattern.row.insert(pattern.row.end(), column.begin(), column.end());
    pattern.begin.push_back(static_cast<int64_t>(pattern.row.size()));
  }
  for (const Edge& edge : edges_) {
    const auto [low, high] = rows_of(edge);
    int64_t entry = -1;
    if (low >= 0 && low != high) {
      const auto first = pattern.row.begin() + pattern.begin[low];
      const auto last = pattern.row.begin() + pattern.begin[low + 1];
      entry = std::lower_bound(first, last, high) - pattern.row.begin();
    }
    entry_of_edge_.push_back(entry);
  }
  values_.resize(pattern.row.size());
  factor_ = std::make_unique<SparseCholesky>(pattern);
}

bool LaplacianSolver::Factorize(std::span<const double> weights, std::span<const double> diagonal) {
  CAIRN_CHECK_EQ(weights.size(), edges_.size());
  CAIRN_CHECK(diagonal.empty() || diagonal.size() == row_of_node_.size());
  std::fill(values_.begin(), values_.end(), 0.0);
  for (size_t e = 0; e < edges_.size(); ++e) {
    const int row1 = row_of_node_[edges_[e].node1];
    const int row2 = row_of_node_[edges_[e].node2];
    if (edges_[e].node1 == edges_[e].node2) continue;
    if (row1 >= 0) values_[diagonal_of_row_[row1]] += weights[e];
    if (row2 >= 0) values_[diagonal_of_row_[row2]] += weights[e];
    if (entry_of_edge_[e] >= 0) values_[entry_of_edge_[e]] -= weights[e];
  }
  for (size_t v = 0; v < diagonal.size(); ++v) {
    if (row_of_node_[v] >= 0) values_[diagonal_of_row_[row_of_node_[v]]] += diagonal[v];
  }
  return factor_->Factorize(values_);
}

Eigen::MatrixXd LaplacianSolver::Solve(const Eigen::MatrixXd& B) const {
  CAIRN_CHECK_EQ(B.rows(), num_nodes_);
  Eigen::MatrixXd rhs(static_cast<Eigen::Index>(diagonal_of_row_.size()), B.cols());
  for (int v = 0; v < num_nodes_; ++v) {
    if (row_of_node_[v] >= 0) rhs.row(row_of_node_[v]) = B.row(v);
  }
  const Eigen::MatrixXd solution = factor_->Solve(rhs);
  Eigen::MatrixXd X = Eigen::MatrixXd::Zero(num_nodes_, B.cols());
  for (int v = 0; v < num_nodes_; ++v) {
    if (row_of_node_[v] >= 0) X.row(v) = solution.row(row_of_node_[v]);
  }
  return X;
}

}  // namespace cairn
