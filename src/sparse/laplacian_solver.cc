#include "sparse/laplacian_solver.h"

#include <algorithm>
#include <utility>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

// An edge joins nodes to an aggregate where it weighs at least this share of the mean at one end.
constexpr double kStrongShare = 0.25;
// Of more aggregates, factorizing their system takes longer than it saves.
constexpr int kMaxAggregates = 2000;
constexpr int kGrain = 256;  // rows a task

}  // namespace

LaplacianSolver::LaplacianSolver(int num_nodes, std::span<const GraphEdge> edges,
                                 std::span<const char> is_gauge, int num_threads,
                                 int max_cholesky_steps)
    : num_nodes_(num_nodes), num_threads_(num_threads), row_of_node_(num_nodes, -1) {
  CAIRN_CHECK_EQ(is_gauge.size(), static_cast<size_t>(num_nodes));
  int num_rows = 0;
  for (int v = 0; v < num_nodes; ++v) {
    if (!is_gauge[v]) row_of_node_[v] = num_rows++;
  }
  rows_of_edge_.reserve(edges.size());
  for (const auto& [node1, node2] : edges) {
    CAIRN_CHECK_NE(node1, node2);
    rows_of_edge_.push_back({row_of_node_[node1], row_of_node_[node2]});
  }

  std::vector<std::vector<int64_t>> columns(num_rows);
  for (int r = 0; r < num_rows; ++r) columns[r].push_back(r);
  for (const auto& [row1, row2] : rows_of_edge_) {
    if (row1 >= 0 && row2 >= 0) columns[std::min(row1, row2)].push_back(std::max(row1, row2));
  }
  SymmetricPattern pattern;
  for (std::vector<int64_t>& column : columns) {
    column = Unique(std::move(column));
    diagonal_of_row_.push_back(pattern.begin.back());
    pattern.row.insert(pattern.row.end(), column.begin(), column.end());
    pattern.begin.push_back(static_cast<int64_t>(pattern.row.size()));
  }
  factor_ = std::make_unique<SparseCholesky>(pattern);
  const double flops_of_step = 3 * 2 * static_cast<double>(2 * pattern.row.size() - num_rows);
  if (factor_->FactorFlops() > max_cholesky_steps * flops_of_step) {
    factor_.reset();
    BuildNeighbors();
  } else {
    FindEntries(pattern);
  }
}

void LaplacianSolver::FindEntries(const SymmetricPattern& pattern) {
  for (const auto& [row1, row2] : rows_of_edge_) {
    int64_t entry = -1;
    if (row1 >= 0 && row2 >= 0) {
      const auto [low, high] = std::minmax(row1, row2);
      const auto first = pattern.row.begin() + pattern.begin[low];
      const auto last = pattern.row.begin() + pattern.begin[low + 1];
      entry = std::lower_bound(first, last, high) - pattern.row.begin();
    }
    entry_of_edge_.push_back(entry);
  }
  values_.resize(pattern.row.size());
}

void LaplacianSolver::BuildNeighbors() {
  std::vector<std::vector<Neighbor>> of_row(diagonal_of_row_.size());
  for (size_t e = 0; e < rows_of_edge_.size(); ++e) {
    const auto [row1, row2] = rows_of_edge_[e];
    if (row1 < 0 || row2 < 0) continue;
    of_row[row1].push_back({row2, static_cast<int>(e)});
    of_row[row2].push_back({row1, static_cast<int>(e)});
  }
  neighbors_begin_ = {0};
  for (const std::vector<Neighbor>& neighbors : of_row) {
    neighbors_.insert(neighbors_.end(), neighbors.begin(), neighbors.end());
    neighbors_begin_.push_back(static_cast<int64_t>(neighbors_.size()));
  }
  neighbor_weights_.resize(neighbors_.size());
}

// Rows whose strong neighbors are all free make an aggregate with these; what remains goes to where
// its strongest neighbor is (Vanek et al., "Algebraic multigrid by smoothed aggregation", 1996).
void LaplacianSolver::FindAggregates() {
  const auto num_rows = static_cast<int>(diagonal_of_row_.size());
  aggregate_of_row_.assign(num_rows, -1);
  num_aggregates_ = 0;
  for (int r = 0; r < num_rows; ++r) {
    const int64_t begin = neighbors_begin_[r], end = neighbors_begin_[r + 1];
    const double strong = kStrongShare * diagonal_[r] / std::max<double>(1, end - begin);
    bool is_free = aggregate_of_row_[r] < 0;
    for (int64_t k = begin; k < end && is_free; ++k) {
      is_free = neighbor_weights_[k] < strong || aggregate_of_row_[neighbors_[k].row] < 0;
    }
    if (!is_free) continue;
    aggregate_of_row_[r] = num_aggregates_;
    for (int64_t k = begin; k < end; ++k) {
      if (neighbor_weights_[k] >= strong) aggregate_of_row_[neighbors_[k].row] = num_aggregates_;
    }
    ++num_aggregates_;
  }
  for (int r = 0; r < num_rows; ++r) {
    if (aggregate_of_row_[r] >= 0) continue;
    double most = 0;
    int joined = -1;
    for (int64_t k = neighbors_begin_[r]; k < neighbors_begin_[r + 1]; ++k) {
      const int aggregate = aggregate_of_row_[neighbors_[k].row];
      if (aggregate < 0 || neighbor_weights_[k] <= most) continue;
      most = neighbor_weights_[k];
      joined = aggregate;
    }
    aggregate_of_row_[r] = joined >= 0 ? joined : num_aggregates_++;
  }
}

void LaplacianSolver::FactorizeAggregates() {
  Eigen::MatrixXd system = Eigen::MatrixXd::Zero(num_aggregates_, num_aggregates_);
  for (size_t r = 0; r < aggregate_of_row_.size(); ++r) {
    const int a = aggregate_of_row_[r];
    system(a, a) += diagonal_[r];
    for (int64_t k = neighbors_begin_[r]; k < neighbors_begin_[r + 1]; ++k) {
      system(aggregate_of_row_[neighbors_[k].row], a) -= neighbor_weights_[k];
    }
  }
  aggregates_.compute(system);
}

LaplacianSolver::Rows LaplacianSolver::Precondition(const Rows& residual) const {
  Rows result = diagonal_.cwiseInverse().asDiagonal() * residual;
  if (num_aggregates_ > kMaxAggregates) return result;
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(num_aggregates_, residual.cols());
  for (Eigen::Index r = 0; r < residual.rows(); ++r)
    sums.row(aggregate_of_row_[r]) += residual.row(r);
  sums = aggregates_.solve(sums);
  for (Eigen::Index r = 0; r < residual.rows(); ++r)
    result.row(r) += sums.row(aggregate_of_row_[r]);
  return result;
}

// (Three columns, those of rotations, are summed in registers.)
template <int kColumns>
void LaplacianSolver::AddNeighbors(const Rows& X, Rows& Y) const {
  using Row = Eigen::Array<double, 1, kColumns>;
  const Eigen::Index num_columns = kColumns == Eigen::Dynamic ? X.cols() : kColumns;
  const auto add = [&](int64_t r) {
    const int64_t begin = neighbors_begin_[r], num = neighbors_begin_[r + 1] - begin;
    const Neighbor* neighbors = neighbors_.data() + begin;
    const double* weights = neighbor_weights_.data() + begin;
    const double* x = X.data();
    Row sum = Row::Zero(num_columns);
    for (int64_t k = 0; k < num; ++k) {
      sum += weights[k] * Eigen::Map<const Row>(x + neighbors[k].row * num_columns, num_columns);
    }
    Y.row(r).array() -= sum;
  };
  ParallelFor(num_threads_, X.rows(), add, kGrain);
}

LaplacianSolver::Rows LaplacianSolver::Multiply(const Rows& X) const {
  Rows Y = diagonal_.asDiagonal() * X;
  X.cols() == 3 ? AddNeighbors<3>(X, Y) : AddNeighbors<Eigen::Dynamic>(X, Y);
  return Y;
}

// All columns at once, each with steps of its own, from X on.
LaplacianSolver::Rows LaplacianSolver::SolveByConjugateGradients(const Rows& B, Rows X,
                                                                 double tolerance) const {
  constexpr int kMaxIterations = 500;
  const Eigen::RowVectorXd target =
      tolerance * tolerance * B.cwiseProduct(Precondition(B)).colwise().sum();
  Rows residual = B - Multiply(X);
  Rows direction = Precondition(residual);
  Eigen::RowVectorXd rho = residual.cwiseProduct(direction).colwise().sum();
  for (int k = 0; k < kMaxIterations && (rho.array() > target.array()).any(); ++k) {
    const Rows image = Multiply(direction);
    const Eigen::RowVectorXd curvature = direction.cwiseProduct(image).colwise().sum();
    for (Eigen::Index c = 0; c < B.cols(); ++c) {
      // A column that is done stays.
      const bool is_done = !(rho[c] > target[c]) || !(curvature[c] > 0);
      const double length = is_done ? 0.0 : rho[c] / curvature[c];
      X.col(c) += length * direction.col(c);
      residual.col(c) -= length * image.col(c);
    }
    const Rows z = Precondition(residual);
    const Eigen::RowVectorXd next_rho = residual.cwiseProduct(z).colwise().sum();
    for (Eigen::Index c = 0; c < B.cols(); ++c) {
      direction.col(c) = z.col(c) + (rho[c] > 0 ? next_rho[c] / rho[c] : 0.0) * direction.col(c);
    }
    rho = next_rho;
  }
  return X;
}

bool LaplacianSolver::Factorize(std::span<const double> weights) {
  CAIRN_CHECK_EQ(weights.size(), rows_of_edge_.size());
  diagonal_.setZero(static_cast<Eigen::Index>(diagonal_of_row_.size()));
  for (size_t e = 0; e < weights.size(); ++e) {
    const auto [row1, row2] = rows_of_edge_[e];
    if (row1 >= 0) diagonal_[row1] += weights[e];
    if (row2 >= 0) diagonal_[row2] += weights[e];
  }
  if (!factor_) {
    for (size_t k = 0; k < neighbors_.size(); ++k) {
      neighbor_weights_[k] = weights[neighbors_[k].edge];
    }
    if (!(diagonal_.array() > 0).all()) return false;
    FindAggregates();
    if (num_aggregates_ <= kMaxAggregates) FactorizeAggregates();
    return true;
  }
  std::fill(values_.begin(), values_.end(), 0.0);
  for (size_t e = 0; e < weights.size(); ++e) {
    if (entry_of_edge_[e] >= 0) values_[entry_of_edge_[e]] -= weights[e];
  }
  for (Eigen::Index r = 0; r < diagonal_.size(); ++r) values_[diagonal_of_row_[r]] = diagonal_[r];
  return factor_->Factorize(values_);
}

LaplacianSolver::Rows LaplacianSolver::RowsOf(const Eigen::MatrixXd& of_nodes) const {
  Rows rows(static_cast<Eigen::Index>(diagonal_of_row_.size()), of_nodes.cols());
  for (int v = 0; v < num_nodes_; ++v) {
    if (row_of_node_[v] >= 0) rows.row(row_of_node_[v]) = of_nodes.row(v);
  }
  return rows;
}

Eigen::MatrixXd LaplacianSolver::Solve(const Eigen::MatrixXd& B, const Eigen::MatrixXd& guess,
                                       double tolerance) const {
  CAIRN_CHECK_EQ(B.rows(), num_nodes_);
  const Rows right = RowsOf(B);
  Rows solution;
  if (factor_) {
    solution = factor_->Solve(right);
  } else {
    Rows start = guess.size() > 0 ? RowsOf(guess) : Rows(Rows::Zero(right.rows(), right.cols()));
    solution = SolveByConjugateGradients(right, std::move(start), tolerance);
  }
  Eigen::MatrixXd X = Eigen::MatrixXd::Zero(num_nodes_, B.cols());
  for (int v = 0; v < num_nodes_; ++v) {
    if (row_of_node_[v] >= 0) X.row(v) = solution.row(row_of_node_[v]);
  }
  return X;
}

}  // namespace cairn
