#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace cairn {

// The lower triangle (diagonal included) of a symmetric matrix in compressed columns: entries of
// column j are row[begin[j]] .. row[begin[j + 1] - 1], in increasing order without repetition.
struct SymmetricPattern {
  std::vector<int64_t> begin = {0};
  std::vector<int64_t> row;

  int Size() const { return static_cast<int>(begin.size()) - 1; }
};

// Cholesky factorization of a sparse symmetric positive definite matrix with a fixed pattern:
// analyzed once (CHOLMOD, Chen, Davis, Hager, Rajamanickam 2008, with 64-bit indices: factors
// beyond 2^31 entries are possible; minimum-degree ordering; simplicial or supernodal by the
// predicted work), refactored for new values as often as needed. BLAS runs on one thread, so the
// result depends on nothing but the input. Throws std::bad_alloc where there is not enough memory.
class SparseCholesky {
 public:
  explicit SparseCholesky(const SymmetricPattern& pattern);
  ~SparseCholesky();
  SparseCholesky(const SparseCholesky&) = delete;
  SparseCholesky& operator=(const SparseCholesky&) = delete;

  // Floating-point operations of one factorization, as predicted.
  double FactorFlops() const;

  // One value for each entry of the pattern. False if the matrix is not positive definite; then
  // Solve must not be called.
  bool Factorize(std::span<const double> values);
  Eigen::MatrixXd Solve(const Eigen::MatrixXd& B) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace cairn
