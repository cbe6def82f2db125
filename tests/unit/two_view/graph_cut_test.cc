#include "two_view/graph_cut.h"

#include <gtest/gtest.h>

#include "cairn/base/rng.h"

namespace cairn::internal {
namespace {

GraphCutProblem RandomProblem(int n, double coherence, Rng& rng) {
  GraphCutProblem problem;
  problem.coherence = coherence;
  for (int i = 0; i < n; ++i) problem.closeness.push_back(rng.Uniform());
  for (int i = 0; i < n; ++i) {
    for (int j = i + 1; j < n; ++j) {
      if (rng.Uniform() < 0.4) problem.neighbours.emplace_back(i, j);
    }
  }
  return problem;
}

// Against every labelling.
TEST(GraphCut, FindsTheLeastEnergy) {
  Rng rng(1);
  for (int trial = 0; trial < 100; ++trial) {
    const int n = 1 + static_cast<int>(rng.UniformInt(9));
    const GraphCutProblem problem = RandomProblem(n, rng.Uniform(0.0, 1.0), rng);
    double least = 1e9;
    for (int bits = 0; bits < (1 << n); ++bits) {
      std::vector<bool> labels(n);
      for (int i = 0; i < n; ++i) labels[i] = (bits >> i & 1) != 0;
      least = std::min(least, GraphCutEnergy(problem, labels));
    }
    EXPECT_NEAR(GraphCutEnergy(problem, MinimizeByGraphCut(problem)), least, 1e-9);
  }
}

TEST(GraphCut, WithoutCoherenceErrorsAloneDecide) {
  Rng rng(2);
  const GraphCutProblem problem = RandomProblem(50, 0.0, rng);
  const std::vector<bool> labels = MinimizeByGraphCut(problem);
  for (int i = 0; i < 50; ++i) EXPECT_EQ(labels[i], problem.closeness[i] > 0.5);
}

TEST(GraphCut, NeighboursShareACellInBothImages) {
  const std::vector<MatchPosition> positions = {
      {{5, 5, 105, 5}}, {{6, 6, 106, 6}}, {{7, 7, 306, 6}}, {{9, 9, 101, 9}}};
  const auto neighbours = NeighboursInGrid(positions, 20.0, 8);
  const std::vector<std::pair<int32_t, int32_t>> expected = {{0, 1}, {0, 3}, {1, 3}};
  EXPECT_EQ(neighbours, expected);
  EXPECT_EQ(NeighboursInGrid(positions, 20.0, 1).size(), 2u);
  EXPECT_TRUE(NeighboursInGrid({}, 20.0, 8).empty());
  EXPECT_TRUE(MinimizeByGraphCut({}).empty());
}

}  // namespace
}  // namespace cairn::internal
