#include "relative_pose_experiments/statistics.h"

#include <cmath>
#include <numeric>

#include "cairn/base/error.h"
#include "relative_pose_experiments/table.h"
#include "support/test.h"

namespace cairn::experiments {
namespace {

TEST(Statistics, QuantilesAreTheNearestRank) {
  const std::vector<double> values = {5, 1, 4, 2, 3};
  EXPECT_EQ(Median(values), 3);
  EXPECT_EQ(Quantile(values, 0.0), 1);
  EXPECT_EQ(Quantile(values, 0.2), 1);
  EXPECT_EQ(Quantile(values, 0.21), 2);
  EXPECT_EQ(Quantile(values, 1.0), 5);
  EXPECT_TRUE(std::isnan(Median({})));
  EXPECT_EQ(Mean(values), 3);
  EXPECT_EQ(ShareBelow(values, 3), 0.4);
  EXPECT_EQ(ShareBelow({}, 3), 0);
}

TEST(Statistics, HistogramHoldsEveryValue) {
  const std::vector<int64_t> counts = LogHistogram({0, 1e-30, 1e-3, 2e-3, 1.0, 1e9});
  EXPECT_EQ(std::accumulate(counts.begin(), counts.end(), int64_t{0}), 6);
  EXPECT_EQ(counts.front(), 2);
  EXPECT_EQ(counts.back(), 1);
  EXPECT_EQ(counts[(0 + 18) * 2], 1);
  EXPECT_EQ(counts[(-3 + 18) * 2], 2);
}

TEST(Table, WritesCsvAndRefusesBrokenRows) {
  Table table;
  table.AddRow({{"a", "x y"}, {"b", 0.1}});
  table.AddRow({{"a", 7}, {"b", 1e-20}});
  EXPECT_EQ(table.ToCsv(), "a,b\nx y,0.1\n7,1e-20\n");
  EXPECT_THROW(table.AddRow({{"a", "short"}}), BugError);
  EXPECT_THROW(table.AddRow({{"b", 0.1}, {"a", "another order"}}), BugError);
  Table names;  // of photographs
  names.AddRow({{"a", "1,\"2\""}});
  EXPECT_EQ(names.ToCsv(), "a\n\"1,\"\"2\"\"\"\n");
}

}  // namespace
}  // namespace cairn::experiments
