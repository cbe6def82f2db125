#include "bundle_adjustment/camera_system.h"

#include <Eigen/Cholesky>
#include <algorithm>

#include "cairn/base/rng.h"
#include "support/test.h"

namespace cairn {
namespace {

using System = CameraSystem<4>;

// Images that see points with the next ones, or with any.
std::vector<std::vector<int>> Columns(int num_images, int num_seen, bool are_near, Rng& rng) {
  std::vector<std::vector<int>> columns(num_images);
  for (int i = 0; i < num_images; ++i) {
    columns[i].push_back(i);
    for (int k = 1; k <= num_seen; ++k) {
      const int j = are_near ? i + k : static_cast<int>(rng.UniformInt(num_images));
      if (j < num_images && j != i) columns[std::min(i, j)].push_back(std::max(i, j));
    }
  }
  for (std::vector<int>& row : columns) {
    std::sort(row.begin(), row.end());
    row.erase(std::unique(row.begin(), row.end()), row.end());
  }
  return columns;
}

struct Filled {
  System system;
  Eigen::MatrixXd dense;  // the same
};

// Blocks J1' J2 of random J, as normal equations have them.
Filled Fill(const std::vector<std::vector<int>>& columns, int num_cameras, double max_factor_flops,
            Rng& rng) {
  std::vector<int> camera_of;
  for (size_t i = 0; i < columns.size(); ++i)
    camera_of.push_back(static_cast<int>(i) % num_cameras);
  Filled filled{System(columns, camera_of, num_cameras, 1, max_factor_flops), {}};
  System& system = filled.system;
  const int n = system.NumUnknowns();
  filled.dense = Eigen::MatrixXd::Zero(n, n);
  for (int i = 0; i < system.NumImages(); ++i) {
    for (int64_t k = system.RowBegin(i); k < system.RowEnd(i); ++k) system.BlockAt(k).setZero();
  }
  const auto place = [&](int i) {
    Eigen::MatrixXd to_all = Eigen::MatrixXd::Zero(System::kBlock, n);
    to_all.block<6, 6>(0, system.PoseAt(i)).setIdentity();
    to_all.block<4, 4>(6, system.IntrinsicsAt(system.CameraOf(i))).setIdentity();
    return to_all;
  };
  using J = Eigen::Matrix<double, 2, System::kBlock>;
  const auto random = [&] { return J(J::NullaryExpr([&] { return rng.Gaussian(); })); };
  for (int i = 0; i < system.NumImages(); ++i) {
    for (int64_t k = system.RowBegin(i); k < system.RowEnd(i); ++k) {
      const int j = system.Column(k);
      const J of_first = random(), of_second = random();
      const int64_t diagonal = system.RowBegin(j);
      system.BlockAt(system.RowBegin(i)) += of_first.transpose() * of_first;
      if (j != i) system.BlockAt(k) += of_first.transpose() * of_second;
      if (j != i) system.BlockAt(diagonal) += of_second.transpose() * of_second;
      Eigen::MatrixXd of_all = of_first * place(i);
      if (j != i) of_all += of_second * place(j);
      std::vector<int> used;
      for (int u = 0; u < n; ++u) {
        if (!of_all.col(u).isZero(0)) used.push_back(u);
      }
      for (const int a : used) {
        for (const int b : used) filled.dense(a, b) += of_all.col(a).dot(of_all.col(b));
      }
    }
  }
  return filled;
}

struct Solved {
  Eigen::VectorXd right, x;
};

// For a random right side; the dense matrix gets the diagonal, too.
Solved Solve(Filled& filled, Rng& rng) {
  const Eigen::Index n = filled.dense.rows();
  const Eigen::VectorXd diagonal = Eigen::VectorXd::Constant(n, 0.1);
  Solved solved{Eigen::VectorXd::NullaryExpr(n, [&] { return rng.Gaussian(); }), {}};
  System& system = filled.system;
  if (system.IsFactorized()) {
    EXPECT_TRUE(system.Factorize(diagonal));
    solved.x = system.SolveByFactor(solved.right);
  } else {
    std::vector<System::IntrinsicsBlock> intrinsics;
    for (int c = 0; c < system.NumCameras(); ++c) {
      const Eigen::Index at = system.IntrinsicsAt(c);
      intrinsics.emplace_back(filled.dense.block<4, 4>(at, at));
    }
    solved.x = system.SolveByProducts([&](const auto& x) { return system.Multiply(x); }, intrinsics,
                                      diagonal, solved.right);
  }
  filled.dense.diagonal() += diagonal;
  return solved;
}

TEST(CameraSystem, IsFactorizedWhereThatIsCheap) {
  Rng rng(1);
  for (const int num_cameras : {1, 3, 40}) {
    Filled filled = Fill(Columns(40, 5, true, rng), num_cameras, 1e8, rng);
    ASSERT_TRUE(filled.system.IsFactorized());
    const auto [right, x] = Solve(filled, rng);
    EXPECT_LT((filled.dense * x - right).norm(), 1e-9 * right.norm());
    const Eigen::VectorXd negative = Eigen::VectorXd::Constant(right.size(), -1e3);
    EXPECT_FALSE(filled.system.Factorize(negative));
  }
}

TEST(CameraSystem, ConjugateGradientsFindMostOfWhatThereIsToGain) {
  Rng rng(2);
  Filled filled = Fill(Columns(300, 4, false, rng), 1, 1e8, rng);
  ASSERT_FALSE(filled.system.IsFactorized());
  const auto [right, x] = Solve(filled, rng);
  const double most = 0.5 * right.dot(filled.dense.ldlt().solve(right));
  const double found = right.dot(x) - 0.5 * x.dot(filled.dense * x);
  EXPECT_GT(found, 0.9 * most);
  EXPECT_LE(found, most * (1 + 1e-9));
}

}  // namespace
}  // namespace cairn
