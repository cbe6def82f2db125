#include "sparse/sparse_cholesky.h"

#include <cholmod.h>

#include <algorithm>
#include <new>
#include <numeric>

#include "base/memory.h"
#include "cairn/base/check.h"
#include "cairn/base/parallel.h"

extern "C" {
void openblas_set_num_threads(int num_threads);
void dpotrf_(const char* uplo, const int* n, double* a, const int* lda, int* info);
}

namespace cairn {
namespace {

static_assert(sizeof(SuiteSparse_long) == sizeof(int64_t));

// Takes OpenBLAS's buffer now, where it is known to be there. Throws std::bad_alloc.
void PrepareBlas() {
  openblas_set_num_threads(1);
  [[maybe_unused]] static const bool is_prepared = [] {
    RequireMemory(160 << 20);
    const int n = 1;
    double one = 1;
    int info = 0;
    dpotrf_("L", &n, &one, &n, &info);
    return info == 0;
  }();
}

void CheckMemory(const cholmod_common& common) {
  if (common.status == CHOLMOD_OUT_OF_MEMORY || common.status == CHOLMOD_TOO_LARGE) {
    throw std::bad_alloc();
  }
}

}  // namespace

struct SparseCholesky::Impl {
  explicit Impl(const SymmetricPattern& pattern) {
    cholmod_l_start(&common);
    common.print = 0;
    common.try_catch = 1;  // report failures by status, print nothing
    common.nmethods = 1;
    common.method[0].ordering = CHOLMOD_AMD;
    common.postorder = 1;
    common.supernodal = CHOLMOD_AUTO;
    // A factor without square roots would accept indefinite matrices.
    common.final_ll = 1;
    matrix.nrow = matrix.ncol = pattern.Size();
    matrix.nzmax = pattern.row.size();
    matrix.p = const_cast<int64_t*>(pattern.begin.data());
    matrix.i = const_cast<int64_t*>(pattern.row.data());
    matrix.stype = -1;
    matrix.itype = CHOLMOD_LONG;
    matrix.xtype = CHOLMOD_PATTERN;
    matrix.dtype = CHOLMOD_DOUBLE;
    matrix.sorted = 1;
    matrix.packed = 1;
    factor = cholmod_l_analyze(&matrix, &common);
    CheckMemory(common);
    CAIRN_CHECK(factor != nullptr);
    flops = common.fl;
    Reorder(pattern);
  }
  ~Impl() {
    cholmod_l_free_factor(&factor, &common);
    cholmod_l_finish(&common);
  }

  // Puts the matrix into the order of its factor once for all. CHOLMOD would transpose it twice for
  // each factorization, which takes longer than a small dense factorization itself.
  void Reorder(const SymmetricPattern& pattern) {
    const int n = pattern.Size();
    auto* const order = static_cast<int64_t*>(factor->Perm);
    place.resize(n);
    for (int k = 0; k < n; ++k) place[order[k]] = k;
    std::iota(order, order + n, 0);
    factor->ordering = CHOLMOD_NATURAL;
    const auto column_of = [&](int j, int64_t k) {
      return std::min(place[j], place[pattern.row[k]]);
    };
    begin.assign(n + 1, 0);
    for (int j = 0; j < n; ++j) {
      for (int64_t k = pattern.begin[j]; k < pattern.begin[j + 1]; ++k)
        ++begin[column_of(j, k) + 1];
    }
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    std::vector<int64_t> next(begin.begin(), begin.end() - 1);
    row.resize(pattern.row.size());
    entry.resize(pattern.row.size());
    for (int j = 0; j < n; ++j) {
      for (int64_t k = pattern.begin[j]; k < pattern.begin[j + 1]; ++k) {
        entry[k] = next[column_of(j, k)]++;
        row[entry[k]] = std::max(place[j], place[pattern.row[k]]);
      }
    }
    values.resize(row.size());
    matrix.p = begin.data();
    matrix.i = row.data();
    matrix.x = values.data();
    matrix.xtype = CHOLMOD_REAL;
    matrix.sorted = 0;
  }

  cholmod_common common = {};
  cholmod_factor* factor = nullptr;
  std::vector<int64_t> place;  // of each unknown in the factor
  std::vector<int64_t> entry;  // of each entry of the pattern in the reordered matrix
  // The reordered matrix.
  cholmod_sparse matrix = {};
  std::vector<int64_t> begin;
  std::vector<int64_t> row;
  std::vector<double> values;
  double flops = 0;
  bool is_factorized = false;
};

SparseCholesky::SparseCholesky(const SymmetricPattern& pattern) {
  CAIRN_CHECK(!pattern.begin.empty());
  CAIRN_CHECK_EQ(static_cast<size_t>(pattern.begin.back()), pattern.row.size());
  PrepareBlas();
  impl_ = std::make_unique<Impl>(pattern);
}

SparseCholesky::~SparseCholesky() = default;

double SparseCholesky::FactorFlops() const { return impl_->flops; }

bool SparseCholesky::Factorize(std::span<const double> values) {
  CAIRN_CHECK_EQ(values.size(), impl_->row.size());
  if (values.empty()) return impl_->is_factorized = true;
  for (size_t k = 0; k < values.size(); ++k) impl_->values[impl_->entry[k]] = values[k];
  impl_->common.status = CHOLMOD_OK;
  const SerialOpenMpScope serial;  // waking threads costs more than a small factorization
  const int ok = cholmod_l_factorize(&impl_->matrix, impl_->factor, &impl_->common);
  CheckMemory(impl_->common);
  impl_->is_factorized = ok && impl_->common.status == CHOLMOD_OK &&
                         impl_->factor->minor == static_cast<size_t>(impl_->factor->n);
  return impl_->is_factorized;
}

Eigen::MatrixXd SparseCholesky::Solve(const Eigen::MatrixXd& B) const {
  CAIRN_CHECK(impl_->is_factorized);
  CAIRN_CHECK_EQ(static_cast<size_t>(B.rows()), impl_->matrix.nrow);
  if (B.size() == 0) return B;
  Eigen::MatrixXd reordered(B.rows(), B.cols());
  for (Eigen::Index i = 0; i < B.rows(); ++i) reordered.row(impl_->place[i]) = B.row(i);
  cholmod_dense rhs = {};
  rhs.nrow = rhs.d = B.rows();
  rhs.ncol = B.cols();
  rhs.nzmax = B.size();
  rhs.x = reordered.data();
  rhs.xtype = CHOLMOD_REAL;
  rhs.dtype = CHOLMOD_DOUBLE;
  const SerialOpenMpScope serial;
  cholmod_dense* solution = cholmod_l_solve(CHOLMOD_A, impl_->factor, &rhs, &impl_->common);
  CheckMemory(impl_->common);
  CAIRN_CHECK(solution != nullptr);
  std::copy_n(static_cast<const double*>(solution->x), B.size(), reordered.data());
  cholmod_l_free_dense(&solution, &impl_->common);
  Eigen::MatrixXd X(B.rows(), B.cols());
  for (Eigen::Index i = 0; i < B.rows(); ++i) X.row(i) = reordered.row(impl_->place[i]);
  return X;
}

}  // namespace cairn
