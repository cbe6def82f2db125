#include "relative_pose_experiments/complexity.h"

#include <cmath>

#include "relative_pose_experiments/operation_counter.h"
#include "relative_pose_experiments/solver_runs.h"
#include "support/test.h"

namespace cairn::experiments {
namespace {

TEST(RansacIterations, AreThoseOfThePapersTable) {
  // The paper rounds to the nearest, and 112.8 of its appendix down.
  EXPECT_EQ(std::lround(RansacIterations(0.50, 5)), 145);
  EXPECT_EQ(std::lround(RansacIterations(0.75, 5)), 4713);
  EXPECT_NEAR(std::log10(RansacIterations(0.90, 5)), 6.0, 0.5);
  EXPECT_EQ(std::lround(RansacIterations(0.50, 2)), 16);
  EXPECT_EQ(std::lround(RansacIterations(0.75, 2)), 71);
  EXPECT_EQ(std::lround(RansacIterations(0.90, 2)), 458);
  EXPECT_EQ(std::lround(RansacIterations(0.50, 1)), 7);
  EXPECT_EQ(std::lround(RansacIterations(0.75, 1)), 16);
  EXPECT_EQ(std::lround(RansacIterations(0.90, 1)), 44);
  EXPECT_NEAR(RansacIterations(0.96, 1), 112.8, 0.05);
}

// Not folded at compile time: every operand is read through a volatile.
TEST(OperationCounter, CountsWhatIsExecuted) {
  if (!CanCountOperations()) GTEST_SKIP() << "this build cannot count operations";
  volatile double a = 2.0, b = 3.0, c = 0.0;
  const OperationCount none = CountOperations([] {});
  EXPECT_EQ(none.Arithmetic(), 0);
  const OperationCount count = CountOperations([&] {
    c = a * b;
    c = c * b;
    c = a + c;
    c = c - b;
    c = c - a;
    c = c / a;
  });
  EXPECT_EQ(count.multiplications, 2);
  EXPECT_EQ(count.additions, 3);
  EXPECT_EQ(count.divisions, 1);
  EXPECT_EQ(count.square_roots, 0);
  EXPECT_GT(count.instructions, none.instructions + 6);
  EXPECT_EQ(c, (2.0 * 3.0 * 3.0 + 2.0 - 3.0 - 2.0) / 2.0);
  volatile float f = 1.5f;
  EXPECT_EQ(CountOperations([&] { f = f * f; }).multiplications, 1);
  EXPECT_EQ(CountOperations([&] { c = std::sqrt(a); }).square_roots, 1);
}

TEST(OperationCounter, IsDeterministic) {
  const auto sample = SampleOf<OneAffineDepthProposed>(MakeInstance(3, 0));
  ScaledPose model;
  const auto solve = [&] { OneAffineDepthProposed::Solve(sample.data(), &model); };
  const OperationCount first = CountOperations(solve), second = CountOperations(solve);
  EXPECT_EQ(first.instructions, second.instructions);
  EXPECT_EQ(first.Arithmetic(), second.Arithmetic());
}

TEST(Complexity, FiguresHoldTheirBounds) {
  const std::vector<FigureCheck> checks = RunComplexity(0, 300, 1).checks;
  // Two of them are of what is counted.
  ASSERT_EQ(checks.size(), CanCountOperations() ? 7u : 5u);
  for (const FigureCheck& check : checks) {
    EXPECT_TRUE(check.Holds()) << check.name << " = " << check.value;
  }
}

}  // namespace
}  // namespace cairn::experiments
