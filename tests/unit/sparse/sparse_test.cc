#include <sys/resource.h>
#include <unistd.h>

#include <Eigen/Dense>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <new>

#include "base/sanitized.h"
#include "cairn/base/rng.h"
#include "sparse/block_cholesky.h"
#include "sparse/laplacian_solver.h"
#include "sparse/sparse_cholesky.h"
#include "support/test.h"

extern "C" void openblas_set_num_threads(int num_threads);

namespace cairn {
namespace {

struct Problem {
  std::vector<GraphEdge> edges;
  std::vector<double> weights;
  std::vector<char> is_gauge;
};

// A connected random graph: a path, and random edges (some parallel).
Problem RandomProblem(int num_nodes, int num_extra, uint64_t seed) {
  Rng rng(seed);
  Problem p;
  for (int v = 1; v < num_nodes; ++v) p.edges.push_back({v - 1, v});
  for (int k = 0; k < num_extra; ++k) {
    const auto v = static_cast<int>(rng.UniformInt(num_nodes));
    p.edges.push_back({v, (v + 1 + static_cast<int>(rng.UniformInt(num_nodes - 1))) % num_nodes});
  }
  for (size_t e = 0; e < p.edges.size(); ++e) p.weights.push_back(rng.Uniform(0.1, 10));
  p.is_gauge.assign(num_nodes, 0);
  p.is_gauge[num_nodes / 3] = 1;
  return p;
}

Eigen::MatrixXd DenseLaplacian(const Problem& p, const std::vector<double>& weights) {
  const int n = static_cast<int>(p.is_gauge.size());
  Eigen::MatrixXd L = Eigen::MatrixXd::Zero(n, n);
  for (size_t e = 0; e < p.edges.size(); ++e) {
    Eigen::VectorXd d = Eigen::VectorXd::Zero(n);
    d[p.edges[e].node1] += 1;
    d[p.edges[e].node2] -= 1;
    L += weights[e] * d * d.transpose();
  }
  return L;
}

Eigen::MatrixXd RandomMatrix(int rows, int cols, uint64_t seed) {
  Rng rng(seed, "matrix");
  Eigen::MatrixXd m(rows, cols);
  for (int i = 0; i < m.size(); ++i) m(i) = rng.Gaussian();
  return m;
}

// Ends this process: 3 where memory is missing, as the programs do.
[[noreturn]] void FactorizeWithin(int64_t bytes_more) {
  int64_t num_pages = 0;
  std::ifstream("/proc/self/statm") >> num_pages;
  const rlim_t limit = num_pages * sysconf(_SC_PAGESIZE) + bytes_more;
  const rlimit memory = {limit, limit};
  setrlimit(RLIMIT_AS, &memory);
  alarm(20);
  SymmetricPattern dense;
  constexpr int kSize = 300;  // BLAS takes part
  std::vector<double> values;
  for (int column = 0; column < kSize; ++column) {
    for (int row = column; row < kSize; ++row) {
      dense.row.push_back(row);
      values.push_back(row == column ? kSize : 0.5);
    }
    dense.begin.push_back(static_cast<int64_t>(dense.row.size()));
  }
  try {
    std::exit(SparseCholesky(dense).Factorize(values) ? 0 : 1);
  } catch (const std::bad_alloc&) {
    std::exit(3);
  }
}

TEST(SparseCholeskyDeathTest, TooLittleMemoryForBlasIsAnErrorNotAWaitForEver) {
  if (CAIRN_SANITIZED) GTEST_SKIP() << "sanitizers take memory and time of their own";
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  // A thread of OpenBLAS's own would ask for its buffer while the limit is set, or after it, and
  // then for ever: the end of this process waits for it (that of the programs does not).
  setenv("OPENBLAS_NUM_THREADS", "1", 1);
  EXPECT_EXIT(FactorizeWithin(100 << 20), ::testing::ExitedWithCode(3), "");
  EXPECT_EXIT(FactorizeWithin(400 << 20), ::testing::ExitedWithCode(0), "");
}

TEST(LaplacianSolver, SolvesWithGaugeForSparseAndDenseGraphs) {
  for (const int num_extra : {0, 30, 3000}) {  // simplicial and supernodal
    const Problem p = RandomProblem(120, num_extra, num_extra);
    LaplacianSolver solver(120, p.edges, p.is_gauge);
    const Eigen::MatrixXd B = RandomMatrix(120, 3, 1);
    for (const double scale : {1.0, 5.0}) {  // one analysis, several factorizations
      std::vector<double> weights = p.weights;
      for (size_t e = 0; e < weights.size(); e += 2) weights[e] *= scale;
      ASSERT_TRUE(solver.Factorize(weights));
      const Eigen::MatrixXd X = solver.Solve(B);
      Eigen::MatrixXd residual = DenseLaplacian(p, weights) * X - B;
      residual.row(40).setZero();
      EXPECT_LT(residual.norm(), 1e-9 * B.norm() * X.norm());
      EXPECT_EQ(X.row(40).norm(), 0);
    }
  }
}

// A street of places with many nodes each: what one end knows has far to go to the other.
TEST(LaplacianSolver, ConjugateGradientsReachFar) {
  constexpr int kPlaces = 300, kNodes = 20;
  Rng rng(3);
  Problem p;
  for (int place = 0; place < kPlaces; ++place) {
    for (int i = 0; i < kNodes; ++i) {
      for (int j = i + 1; j < kNodes; ++j) {
        p.edges.push_back({place * kNodes + i, place * kNodes + j});
      }
      if (place > 0) p.edges.push_back({place * kNodes + i, (place - 1) * kNodes + i});
    }
  }
  for (size_t e = 0; e < p.edges.size(); ++e) p.weights.push_back(rng.Uniform(0.5, 2));
  p.is_gauge.assign(kPlaces * kNodes, 0);
  p.is_gauge[0] = 1;
  const Eigen::MatrixXd B = RandomMatrix(kPlaces * kNodes, 3, 1);
  LaplacianSolver exact(kPlaces * kNodes, p.edges, p.is_gauge);
  ASSERT_TRUE(exact.UsesCholesky() && exact.Factorize(p.weights));
  const Eigen::MatrixXd X = exact.Solve(B);
  for (const int num_threads : {1, 2}) {
    LaplacianSolver solver(kPlaces * kNodes, p.edges, p.is_gauge, num_threads, 0);
    ASSERT_TRUE(!solver.UsesCholesky() && solver.Factorize(p.weights));
    EXPECT_LT((solver.Solve(B) - X).norm(), 1e-2 * X.norm());
  }
}

TEST(LaplacianSolver, RefusesALooseGraph) {
  const std::vector<GraphEdge> edges = {{0, 1}, {2, 3}};
  const std::vector<char> gauge = {1, 0, 0, 0};
  LaplacianSolver solver(4, edges, gauge);
  EXPECT_FALSE(solver.Factorize(std::vector<double>{1, 1}));
  const std::vector<char> two_gauges = {1, 0, 0, 1};
  LaplacianSolver fixed(4, edges, two_gauges);
  EXPECT_TRUE(fixed.Factorize(std::vector<double>{1, 1}));
  EXPECT_FALSE(fixed.Factorize(std::vector<double>{1, 0}));
}

TEST(LaplacianSolver, OnlyGaugeNodes) {
  LaplacianSolver solver(1, {}, std::vector<char>{1});
  ASSERT_TRUE(solver.Factorize({}));
  EXPECT_EQ(solver.Solve(Eigen::MatrixXd::Ones(1, 3)).norm(), 0);
}

TEST(LaplacianSolver, SameBytesWhateverBlasThreadsWere) {
  const Problem p = RandomProblem(400, 20000, 9);
  const Eigen::MatrixXd B = RandomMatrix(400, 3, 3);
  std::vector<Eigen::MatrixXd> results;
  for (const int threads : {1, 2}) {
    openblas_set_num_threads(threads);
    LaplacianSolver solver(400, p.edges, p.is_gauge);
    ASSERT_TRUE(solver.Factorize(p.weights));
    results.push_back(solver.Solve(B));
  }
  EXPECT_EQ(std::memcmp(results[0].data(), results[1].data(), results[0].size() * 8), 0);
}

TEST(LaplacianSolver, ConjugateGradientsAgreeWithCholesky) {
  const Problem p = RandomProblem(400, 20000, 9);
  const Eigen::MatrixXd B = RandomMatrix(400, 3, 3);
  LaplacianSolver direct(400, p.edges, p.is_gauge), iterative(400, p.edges, p.is_gauge, 1, 0);
  EXPECT_TRUE(direct.UsesCholesky());
  EXPECT_FALSE(iterative.UsesCholesky());
  ASSERT_TRUE(direct.Factorize(p.weights));
  ASSERT_TRUE(iterative.Factorize(p.weights));
  const Eigen::MatrixXd expected = direct.Solve(B);
  EXPECT_LT((iterative.Solve(B) - expected).norm(), 1e-3 * expected.norm());
  EXPECT_FALSE(iterative.Factorize(std::vector<double>(p.edges.size(), 0.0)));
}

TEST(SparseCholesky, PredictsWorkAndRejectsIndefinite) {
  SymmetricPattern pattern;  // [a b; b c]
  pattern.begin = {0, 2, 3};
  pattern.row = {0, 1, 1};
  SparseCholesky cholesky(pattern);
  EXPECT_GT(cholesky.FactorFlops(), 0);
  EXPECT_FALSE(cholesky.Factorize(std::vector<double>{1, 2, 1}));
  ASSERT_TRUE(cholesky.Factorize(std::vector<double>{2, 1, 2}));
  const Eigen::MatrixXd X = cholesky.Solve(Eigen::Vector2d(3, 3));
  EXPECT_NEAR((X - Eigen::Vector2d(1, 1)).norm(), 0, 1e-14);
}

TEST(BlockCholesky, SolvesWhatWasAddedAndCanBeFilledAgain) {
  const BlockPattern pattern{{3, 1, 2, 4}, {{0, 2, 3}, {1, 3}, {2, 3}, {3}}};
  const std::vector<int> first = {0, 3, 4, 6, 10};
  EXPECT_GT(EstimateFactorFlops(pattern), 100);
  BlockCholesky matrix(pattern);
  for (const uint64_t seed : {1, 2}) {
    Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(10, 10);
    matrix.SetZero();
    for (int column = 0; column < 4; ++column) {
      for (const int row : pattern.columns[column]) {
        for (const uint64_t part : {0, 1}) {  // they add up
          Eigen::MatrixXd block = RandomMatrix(pattern.sizes[row], pattern.sizes[column],
                                               100 * seed + 10 * row + 2 * column + part);
          if (row == column) block = block + block.transpose().eval();
          matrix.Add(row, column, block);
          dense.block(first[row], first[column], block.rows(), block.cols()) += block;
          if (row != column) {
            dense.block(first[column], first[row], block.cols(), block.rows()) += block.transpose();
          }
        }
      }
    }
    const Eigen::VectorXd b = RandomMatrix(10, 1, seed);
    EXPECT_FALSE(matrix.Factorize());  // indefinite
    const Eigen::VectorXd diagonal = Eigen::VectorXd::LinSpaced(10, 30, 40);
    matrix.AddToDiagonal(diagonal);
    dense.diagonal() += diagonal;
    ASSERT_TRUE(matrix.Factorize());
    EXPECT_LT((dense * matrix.Solve(b) - b).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace cairn
