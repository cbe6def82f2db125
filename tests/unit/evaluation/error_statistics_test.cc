#include "cairn/evaluation/error_statistics.h"

#include <cmath>
#include <limits>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "support/test.h"

namespace cairn {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

TEST(RecallAuc, KnownValues) {
  EXPECT_EQ(RecallAuc({}, 5), 0.0);
  EXPECT_EQ(RecallAuc({kInfinity, kInfinity}, 5), 0.0);
  EXPECT_EQ(RecallAuc({0, 0, 0}, 5), 1.0);
  EXPECT_EQ(RecallAuc({5}, 5), 0.0);  // an error at the threshold is not below it
  // One error in the middle: a triangle up to it, then recall 1.
  EXPECT_DOUBLE_EQ(RecallAuc({2.5}, 5), 0.75);
  EXPECT_DOUBLE_EQ(RecallAuc({2.5, kInfinity}, 5), 0.375);
  EXPECT_DOUBLE_EQ(RecallAuc({3, 1}, 4), (0.5 * 1 * 0.5 + 0.75 * 2 + 1.0) / 4);
  EXPECT_THROW(RecallAuc({1}, 0), BugError);
}

TEST(RecallAuc, DoesNotDependOnOrderAndFallsWithErrors) {
  Rng rng(1);
  std::vector<double> errors;
  for (int i = 0; i < 200; ++i) errors.push_back(rng.Uniform(0, 8));
  const double auc = RecallAuc(errors, 5);
  rng.Shuffle(errors);
  EXPECT_EQ(RecallAuc(errors, 5), auc);
  for (double& error : errors) error *= 1.1;
  EXPECT_LT(RecallAuc(errors, 5), auc);
}

TEST(Median, OddEvenEmpty) {
  EXPECT_EQ(Median({}), 0);
  EXPECT_EQ(Median({3, 1, 2}), 2);
  EXPECT_EQ(Median({4, 1, 3, 2}), 2.5);
  EXPECT_EQ(Median({1, kInfinity, kInfinity}), kInfinity);
}

TEST(ErrorStatistics, MeanMedianDeviation) {
  const ErrorStatistics s = ComputeErrorStatistics({1, 2, 3, 10});
  EXPECT_DOUBLE_EQ(s.mean, 4);
  EXPECT_DOUBLE_EQ(s.median, 2.5);
  EXPECT_DOUBLE_EQ(s.standard_deviation, std::sqrt(12.5));
  EXPECT_EQ(s.count, 4);
  EXPECT_EQ(ComputeErrorStatistics({}).count, 0);
}

}  // namespace
}  // namespace cairn
