#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "cairn/base/parallel.h"
#include "sparse/sparse_cholesky.h"

namespace cairn {

// Which blocks of a sparse symmetric matrix there are. Node i has sizes[i] unknowns, one node after
// the other; columns[j]: the nodes from j on whose block with j is not zero, ascending, j first.
struct BlockPattern {
  std::vector<int> sizes;
  std::vector<std::vector<int>> columns;
};

// The columns of a pattern of n nodes: visit(i, use) calls use(j) for the nodes that share a block
// with node i. Those before i, and repetitions, do not matter.
template <class Visit>
std::vector<std::vector<int>> JoinedColumns(int n, int num_threads, const Visit& visit) {
  std::vector<std::vector<int>> columns(n);
  std::vector<std::vector<int>> found_for(EffectiveNumThreads(num_threads));  // by worker
  const auto find = [&](int worker, int64_t column) {
    const auto i = static_cast<int>(column);
    std::vector<int>& found = found_for[worker];
    found.resize(n, -1);
    columns[i].push_back(i);
    visit(i, [&](int j) {
      if (j > i && std::exchange(found[j], i) != i) columns[i].push_back(j);
    });
    std::sort(columns[i].begin(), columns[i].end());
  };
  ParallelForWorker(num_threads, n, find, /*grain=*/4);
  return columns;
}

// Floating-point operations of a factorization, about: as if all nodes had the mean size.
double EstimateFactorFlops(const BlockPattern& pattern);

// A sparse symmetric positive definite matrix of dense blocks, and its Cholesky factorization
// (SparseCholesky): analyzed once, filled and factorized as often as needed.
class BlockCholesky {
 public:
  explicit BlockCholesky(BlockPattern pattern);

  double FactorFlops() const { return factor_->FactorFlops(); }
  void SetZero() { std::fill(values_.begin(), values_.end(), 0.0); }
  // Adds to the block of two nodes, row >= column; of a node with itself the lower triangle.
  template <class Block>
  void Add(int row, int column, const Eigen::MatrixBase<Block>& block);
  void AddToDiagonal(const Eigen::VectorXd& diagonal);
  // False if the matrix is not positive definite; then Solve must not be called.
  bool Factorize() { return factor_->Factorize(values_); }
  Eigen::VectorXd Solve(const Eigen::VectorXd& b) const { return factor_->Solve(b); }

 private:
  // Where a block begins in its first column of unknowns, as if the diagonal block were full.
  int OffsetOf(int row, int column) const;

  BlockPattern pattern_;
  std::vector<std::vector<int>> offsets_;  // of each block in a column, by node
  std::vector<int> first_;                 // unknown of each node
  std::vector<int64_t> begin_;             // of each unknown's column in values_
  std::vector<double> values_;
  std::unique_ptr<SparseCholesky> factor_;
};

template <class Block>
void BlockCholesky::Add(int row, int column, const Eigen::MatrixBase<Block>& block) {
  const int offset = OffsetOf(row, column);
  for (int c = 0; c < block.cols(); ++c) {
    double* const entry = values_.data() + begin_[first_[column] + c] + offset - c;
    for (int r = row == column ? c : 0; r < block.rows(); ++r) entry[r] += block(r, c);
  }
}

}  // namespace cairn
