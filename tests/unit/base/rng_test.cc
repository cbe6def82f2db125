#include "cairn/base/rng.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <vector>

#include "support/test.h"

namespace cairn {
namespace {

// Stored results depend on these numbers: they must never change. They were checked against an
// independent implementation of SplitMix64 and xoshiro256** in Python.
TEST(Rng, KnownAnswers) {
  Rng rng(0);
  EXPECT_EQ(rng.NextU64(), 0x4702c1b4b8c60ba4u);
  EXPECT_EQ(rng.NextU64(), 0xdd334dd07a4225bdu);
  EXPECT_EQ(rng.NextU64(), 0x12a9c34b8dcb8a26u);
}

TEST(Rng, SeedStageAndIdMatter) {
  const uint64_t reference = Rng(1, "stage", 2).NextU64();
  EXPECT_EQ(Rng(1, "stage", 2).NextU64(), reference);
  EXPECT_NE(Rng(2, "stage", 2).NextU64(), reference);
  EXPECT_NE(Rng(1, "stages", 2).NextU64(), reference);
  EXPECT_NE(Rng(1, "stage", 3).NextU64(), reference);
}

TEST(Rng, UniformIntIsUniform) {
  Rng rng(1);
  std::vector<int> counts(7);
  for (int i = 0; i < 70000; ++i) ++counts[rng.UniformInt(7)];
  for (const int count : counts) EXPECT_NEAR(count, 10000, 400);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(rng.UniformInt(1), 0u);
}

TEST(Rng, UniformAndGaussianHaveTheirMoments) {
  Rng rng(2);
  const int n = 200000;
  double sum = 0, squares = 0, gaussian = 0, gaussian2 = 0, gaussian4 = 0;
  for (int i = 0; i < n; ++i) {
    const double u = rng.Uniform();
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    sum += u;
    squares += u * u;
    const double g = rng.Gaussian();
    gaussian += g;
    gaussian2 += g * g;
    gaussian4 += g * g * g * g;
  }
  EXPECT_NEAR(sum / n, 0.5, 0.005);
  EXPECT_NEAR(squares / n, 1.0 / 3.0, 0.005);
  EXPECT_NEAR(gaussian / n, 0, 0.01);
  EXPECT_NEAR(gaussian2 / n, 1, 0.02);
  EXPECT_NEAR(gaussian4 / n, 3, 0.15);
  const double x = rng.Uniform(-3, -2);
  EXPECT_TRUE(x >= -3 && x < -2);
}

TEST(Rng, SampleIsDistinctAndCoversAll) {
  Rng rng(3);
  std::set<uint32_t> seen;
  for (int i = 0; i < 200; ++i) {
    uint32_t sample[5];
    rng.Sample(8, 5, sample);
    const std::set<uint32_t> distinct(sample, sample + 5);
    EXPECT_EQ(distinct.size(), 5u);
    EXPECT_LT(*distinct.rbegin(), 8u);
    seen.insert(distinct.begin(), distinct.end());
  }
  EXPECT_EQ(seen.size(), 8u);
  uint32_t all[4];
  rng.Sample(4, 4, all);
  EXPECT_EQ(std::set<uint32_t>(all, all + 4).size(), 4u);
}

TEST(Rng, ShuffleIsAUniformPermutation) {
  Rng rng(4);
  std::vector<int> first(4);
  for (int i = 0; i < 24000; ++i) {
    std::vector<int> values(4);
    std::iota(values.begin(), values.end(), 0);
    rng.Shuffle(values);
    EXPECT_TRUE(std::is_permutation(values.begin(), values.end(), std::vector{0, 1, 2, 3}.begin()));
    ++first[values[0]];
  }
  for (const int count : first) EXPECT_NEAR(count, 6000, 300);
}

}  // namespace
}  // namespace cairn
