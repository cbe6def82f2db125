#include "bundle_adjustment/schur_kernels.h"

#include <Eigen/Core>
#include <vector>

#include "cairn/base/rng.h"
#include "support/instruction_sets.h"
#include "support/test.h"

namespace cairn {
namespace {

template <int kBlock>
void ExpectSumsOfProducts() {
  using Jacobian = Eigen::Matrix<double, 2, kBlock, Eigen::RowMajor>;
  using FloatJacobian = Eigen::Matrix<float, 2, kBlock, Eigen::RowMajor>;
  using Block = Eigen::Matrix<double, kBlock, kBlock, Eigen::RowMajor>;
  Rng rng(kBlock, "schur_kernels_test");
  const auto fill = [&](auto& matrix) {
    for (auto& value : matrix.reshaped()) {
      value = static_cast<std::decay_t<decltype(value)>>(rng.Gaussian());
    }
  };
  Jacobian J;
  fill(J);
  std::vector<FloatJacobian> C(3);
  std::vector<Eigen::Matrix2d> M(3);
  std::vector<Block> start(2), expected;
  for (FloatJacobian& each : C) fill(each);
  for (Eigen::Matrix2d& each : M) fill(each);
  for (Block& each : start) fill(each);
  expected = start;
  const int block_of[] = {0, 1, 1};
  for (int i = 0; i < 3; ++i) {
    expected[block_of[i]] -= J.transpose() * M[i] * C[i].template cast<double>();
  }
  std::vector<Block> first;
  ForEachInstructionSet([&] {
    std::vector<Block> blocks = start;
    std::vector<internal::SchurPartner> partners;
    for (int i = 0; i < 3; ++i) {
      partners.push_back({{M[i](0, 0), M[i](0, 1), M[i](1, 0), M[i](1, 1)},
                          C[i].data(),
                          blocks[block_of[i]].data()});
    }
    internal::SubtractFromBlocks(kBlock, J.data(), partners.data(), 3);
    for (int k = 0; k < 2; ++k) EXPECT_TRUE(blocks[k].isApprox(expected[k], 1e-12));
    if (first.empty()) first = blocks;
    EXPECT_EQ(blocks, first) << "the bits depend on the instruction set";
  });
}

TEST(SchurKernels, SubtractProductsWithAnyInstructionSet) {
  ExpectSumsOfProducts<10>();
  ExpectSumsOfProducts<22>();
}

}  // namespace
}  // namespace cairn
