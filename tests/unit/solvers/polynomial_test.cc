#include "cairn/solvers/polynomial.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "cairn/base/rng.h"
#include "support/instruction_sets.h"
#include "support/test.h"

namespace cairn {
namespace {

// Coefficients of a polynomial with given real roots, times (x^2 + 1) (x^2 + 2) ... for
// `num_complex_pairs` pairs of complex roots.
std::vector<double> FromRoots(const std::vector<double>& roots, int num_complex_pairs) {
  std::vector<double> c = {1.0};
  for (const double root : roots) {
    std::vector<double> next(c.size() + 1, 0.0);
    for (size_t i = 0; i < c.size(); ++i) {
      next[i + 1] += c[i];
      next[i] -= root * c[i];
    }
    c = next;
  }
  for (int k = 0; k < num_complex_pairs; ++k) {
    std::vector<double> next(c.size() + 2, 0.0);
    for (size_t i = 0; i < c.size(); ++i) {
      next[i + 2] += c[i];
      next[i] += (k + 1.0) * c[i];
    }
    c = next;
  }
  return c;
}

TEST(RealRoots, FindsAllSeparatedRootsOfEveryDegree) {
  Rng rng(1);
  for (int trial = 0; trial < 2000; ++trial) {
    const int num_real = 1 + static_cast<int>(rng.UniformInt(10));
    const int num_pairs = static_cast<int>(rng.UniformInt((10 - num_real) / 2 + 1));
    std::vector<double> expected;
    while (static_cast<int>(expected.size()) < num_real) {
      const double root = rng.Uniform(-2.0, 2.0);
      if (std::all_of(expected.begin(), expected.end(),
                      [&](double other) { return std::abs(other - root) > 0.05; })) {
        expected.push_back(root);
      }
    }
    std::sort(expected.begin(), expected.end());
    std::vector<double> c = FromRoots(expected, num_pairs);
    for (double& value : c) value *= -3.0;
    double roots[10];
    const int count = RealRoots(c.data(), static_cast<int>(c.size()) - 1, roots);
    ASSERT_EQ(count, num_real);
    for (int i = 0; i < count; ++i) EXPECT_NEAR(roots[i], expected[i], 1e-5);
  }
}

TEST(RealRoots, HandlesLowDegreesAndVanishingLeadingCoefficients) {
  double roots[10];
  const double constant[3] = {1.0, 0.0, 0.0};
  EXPECT_EQ(RealRoots(constant, 2, roots), 0);
  const double zero[4] = {};
  EXPECT_EQ(RealRoots(zero, 3, roots), 0);
  const double linear[5] = {2.0, -4.0, 0.0, 0.0, 0.0};
  ASSERT_EQ(RealRoots(linear, 4, roots), 1);
  EXPECT_DOUBLE_EQ(roots[0], 0.5);
  const double quadratic[3] = {-2.0, 0.0, 1.0};
  ASSERT_EQ(RealRoots(quadratic, 2, roots), 2);
  EXPECT_DOUBLE_EQ(roots[0], -std::sqrt(2.0));
  EXPECT_DOUBLE_EQ(roots[1], std::sqrt(2.0));
  const double none[3] = {1.0, 0.0, 1.0};
  EXPECT_EQ(RealRoots(none, 2, roots), 0);
  const double biquadratic[5] = {-1.0, 0.0, 0.0, 0.0, 1.0};  // x^4 = 1: the chain loses degrees
  ASSERT_EQ(RealRoots(biquadratic, 4, roots), 2);
  EXPECT_NEAR(roots[0], -1.0, 1e-14);
  EXPECT_NEAR(roots[1], 1.0, 1e-14);
  const double not_finite[4] = {1.0, 2.0, NAN, 1.0};
  EXPECT_EQ(RealRoots(not_finite, 3, roots), 0);
}

TEST(RealRoots, CoversManyOrdersOfMagnitude) {
  const std::vector<double> c = FromRoots({-1e4, -1e-4, 1e-3, 5e3}, 0);
  double roots[10];
  ASSERT_EQ(RealRoots(c.data(), 4, roots), 4);
  EXPECT_NEAR(roots[0], -1e4, 1e-6);
  EXPECT_NEAR(roots[1], -1e-4, 1e-9);
  EXPECT_NEAR(roots[2], 1e-3, 1e-9);
  EXPECT_NEAR(roots[3], 5e3, 1e-6);
}

// The same bits with every instruction set of this machine.
TEST(RealRoots, DoesNotDependOnTheInstructionSet) {
  auto compute = [] {
    Rng rng(9);
    std::vector<double> all;
    for (int trial = 0; trial < 500; ++trial) {
      const int degree = 3 + static_cast<int>(rng.UniformInt(8));
      double c[11], roots[10];
      for (int i = 0; i <= degree; ++i) c[i] = rng.Gaussian();
      const int count = RealRoots(c, degree, roots);
      all.insert(all.end(), roots, roots + count);
    }
    return all;
  };
  const std::vector<double> expected = compute();
  EXPECT_GT(expected.size(), 500u);
  ForEachInstructionSet([&] { EXPECT_EQ(compute(), expected); });
}

}  // namespace
}  // namespace cairn
