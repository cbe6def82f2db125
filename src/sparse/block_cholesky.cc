#include "sparse/block_cholesky.h"

#include <cmath>
#include <numeric>

namespace cairn {

double EstimateFactorFlops(const BlockPattern& pattern) {
  SymmetricPattern nodes;
  for (const std::vector<int>& column : pattern.columns) {
    nodes.row.insert(nodes.row.end(), column.begin(), column.end());
    nodes.begin.push_back(static_cast<int64_t>(nodes.row.size()));
  }
  const double num_unknowns = std::accumulate(pattern.sizes.begin(), pattern.sizes.end(), 0.0);
  const double mean_size = num_unknowns / static_cast<double>(pattern.sizes.size());
  return SparseCholesky(nodes).FactorFlops() * std::pow(mean_size, 3);
}

BlockCholesky::BlockCholesky(BlockPattern pattern) : pattern_(std::move(pattern)), first_{0} {
  for (const int size : pattern_.sizes) first_.push_back(first_.back() + size);
  SymmetricPattern unknowns;
  for (size_t j = 0; j < pattern_.columns.size(); ++j) {
    std::vector<int>& offsets = offsets_.emplace_back();
    std::vector<int64_t> rows;
    for (const int i : pattern_.columns[j]) {
      offsets.push_back(static_cast<int>(rows.size()));
      for (int row = first_[i]; row < first_[i + 1]; ++row) rows.push_back(row);
    }
    for (int c = 0; c < pattern_.sizes[j]; ++c) {
      unknowns.row.insert(unknowns.row.end(), rows.begin() + c, rows.end());
      unknowns.begin.push_back(static_cast<int64_t>(unknowns.row.size()));
    }
  }
  begin_ = unknowns.begin;
  values_.resize(unknowns.row.size());
  factor_ = std::make_unique<SparseCholesky>(unknowns);
}

int BlockCholesky::OffsetOf(int row, int column) const {
  const std::vector<int>& rows = pattern_.columns[column];
  const auto at = std::lower_bound(rows.begin(), rows.end(), row) - rows.begin();
  return offsets_[column][at];
}

void BlockCholesky::AddToDiagonal(const Eigen::VectorXd& diagonal) {
  for (Eigen::Index i = 0; i < diagonal.size(); ++i) values_[begin_[i]] += diagonal[i];
}

}  // namespace cairn
