#include "sparse/sparse_cholesky.h"

#include <cholmod.h>

#include <algorithm>
#include <new>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"

extern "C" void openblas_set_num_threads(int num_threads);

namespace cairn {
namespace {

static_assert(sizeof(SuiteSparse_long) == sizeof(int64_t));

void CheckMemory(const cholmod_common& common) {
  if (common.status == CHOLMOD_OUT_OF_MEMORY || common.status == CHOLMOD_TOO_LARGE) {
    throw std::bad_alloc();
  }
}

}  // namespace

struct SparseCholesky::Impl {
  explicit Impl(const SymmetricPattern& pattern) : begin(pattern.begin), row(pattern.row) {
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
    matrix.nzmax = row.size();
    matrix.p = begin.data();
    matrix.i = row.data();
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
    entries = common.lnz;
  }
  ~Impl() {
    cholmod_l_free_factor(&factor, &common);
    cholmod_l_finish(&common);
  }

  cholmod_common common = {};
  cholmod_sparse matrix = {};
  cholmod_factor* factor = nullptr;
  std::vector<int64_t> begin;
  std::vector<int64_t> row;
  double flops = 0;
  double entries = 0;
  bool is_factorized = false;
};

SparseCholesky::SparseCholesky(const SymmetricPattern& pattern) {
  CAIRN_CHECK(!pattern.begin.empty());
  CAIRN_CHECK_EQ(static_cast<size_t>(pattern.begin.back()), pattern.row.size());
  openblas_set_num_threads(1);
  impl_ = std::make_unique<Impl>(pattern);
}

SparseCholesky::~SparseCholesky() = default;

double SparseCholesky::FactorFlops() const { return impl_->flops; }
double SparseCholesky::FactorEntries() const { return impl_->entries; }

bool SparseCholesky::Factorize(std::span<const double> values) {
  CAIRN_CHECK_EQ(values.size(), impl_->row.size());
  if (values.empty()) return impl_->is_factorized = true;
  cholmod_sparse matrix = impl_->matrix;
  matrix.x = const_cast<double*>(values.data());
  matrix.xtype = CHOLMOD_REAL;
  impl_->common.status = CHOLMOD_OK;
  const SerialOpenMpScope serial;  // waking threads costs more than a small factorization
  const int ok = cholmod_l_factorize(&matrix, impl_->factor, &impl_->common);
  CheckMemory(impl_->common);
  impl_->is_factorized = ok && impl_->common.status == CHOLMOD_OK &&
                         impl_->factor->minor == static_cast<size_t>(impl_->factor->n);
  return impl_->is_factorized;
}

Eigen::MatrixXd SparseCholesky::Solve(const Eigen::MatrixXd& B) const {
  CAIRN_CHECK(impl_->is_factorized);
  CAIRN_CHECK_EQ(static_cast<size_t>(B.rows()), impl_->matrix.nrow);
  Eigen::MatrixXd X(B.rows(), B.cols());
  if (B.size() == 0) return X;
  cholmod_dense rhs = {};
  rhs.nrow = rhs.d = B.rows();
  rhs.ncol = B.cols();
  rhs.nzmax = B.size();
  rhs.x = const_cast<double*>(B.data());
  rhs.xtype = CHOLMOD_REAL;
  rhs.dtype = CHOLMOD_DOUBLE;
  const SerialOpenMpScope serial;
  cholmod_dense* solution = cholmod_l_solve(CHOLMOD_A, impl_->factor, &rhs, &impl_->common);
  CheckMemory(impl_->common);
  CAIRN_CHECK(solution != nullptr);
  std::copy_n(static_cast<const double*>(solution->x), B.size(), X.data());
  cholmod_l_free_dense(&solution, &impl_->common);
  return X;
}

}  // namespace cairn
