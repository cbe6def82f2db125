#include "intrinsics/sparse_normals.h"

#include <Eigen/Cholesky>
#include <Eigen/IterativeLinearSolvers>
#include <map>
#include <vector>

namespace cairn::internal {

bool SparseNormals::DampedStep(double damping, double max_step, Eigen::VectorXd* step) const {
  Eigen::SparseMatrix<double> damped = hessian;
  damped.diagonal() *= 1 + damping;
  Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower | Eigen::Upper> solver(damped);
  *step = (-solver.solve(gradient)).cwiseMax(-max_step).cwiseMin(max_step);
  return step->allFinite();
}

double SparseNormals::LocalVariance(Eigen::Index v) const {
  const Eigen::SparseMatrix<double>& H = hessian;
  constexpr size_t kMaxFree = 200;
  std::vector<Eigen::Index> free = {v};
  std::map<Eigen::Index, Eigen::Index> index = {{v, 0}};
  for (size_t k = 0; k < free.size(); ++k) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(H, free[k]); it; ++it) {
      if (free.size() == kMaxFree || !index.try_emplace(it.row(), free.size()).second) continue;
      free.push_back(it.row());
    }
  }
  const auto n = static_cast<Eigen::Index>(free.size());
  Eigen::MatrixXd block = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(H, free[i]); it; ++it) {
      const auto j = index.find(it.row());
      if (j != index.end()) block(j->second, i) = it.value();
    }
  }
  return block.llt().solve(Eigen::VectorXd::Unit(n, 0))[0];
}

}  // namespace cairn::internal
