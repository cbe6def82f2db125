#include "cairn/matching/matching.h"

#define HWY_WANT_AVX3_DL  // As in nearest_two.cc: it then counts as a target.
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include "cairn/base/error.h"
#include "cairn/base/rng.h"
#include "matching/nearest_two.h"
#include "support/instruction_sets.h"
#include "support/test.h"

namespace cairn {
namespace {

Descriptors RandomDescriptors(int n, uint64_t seed, int max_value = 255) {
  Rng rng(seed, "descriptors");
  Descriptors descriptors(n, 128);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < 128; ++k) {
      descriptors(i, k) = static_cast<uint8_t>(rng.UniformInt(max_value + 1));
    }
  }
  return descriptors;
}

// Rows of `descriptors` in another order, each element moved by at most `noise`.
Descriptors Shuffled(const Descriptors& descriptors, const std::vector<int>& order, int noise) {
  Rng rng(7, "noise");
  Descriptors result(order.size(), 128);
  for (size_t i = 0; i < order.size(); ++i) {
    for (int k = 0; k < 128; ++k) {
      const int value =
          descriptors(order[i], k) + static_cast<int>(rng.UniformInt(2 * noise + 1)) - noise;
      result(i, k) = static_cast<uint8_t>(std::clamp(value, 0, 255));
    }
  }
  return result;
}

int SquaredDistance(const Descriptors& a, int i, const Descriptors& b, int j) {
  int sum = 0;
  for (int k = 0; k < 128; ++k) sum += (a(i, k) - b(j, k)) * (a(i, k) - b(j, k));
  return sum;
}

// The nearest two of row i of `a` among `b`.
NearestTwo NaiveNearestTwo(const Descriptors& a, int i, const Descriptors& b) {
  NearestTwo nearest;
  for (int j = 0; j < b.rows(); ++j) {
    const int distance = SquaredDistance(a, i, b, j);
    if (distance < nearest.best) {
      nearest = {distance, nearest.best, j};
    } else {
      nearest.second = std::min(nearest.second, distance);
    }
  }
  return nearest;
}

FeatureMatches NaiveMatches(const Descriptors& a, const Descriptors& b,
                            const MatchingOptions& options) {
  const double max_squared = std::pow(512 * options.max_distance, 2);
  const auto passes = [&](const NearestTwo& n) {
    return n.index >= 0 && n.best <= max_squared &&
           (n.second == kNoNeighbor || n.best < options.max_ratio * options.max_ratio * n.second);
  };
  const auto squared_ratio = [](const NearestTwo& n) {
    return n.second == kNoNeighbor ? 0.0 : static_cast<double>(n.best) / n.second;
  };
  std::vector<std::tuple<double, point2D_t, point2D_t>> ranked;
  for (int i = 0; i < a.rows(); ++i) {
    const NearestTwo forward = NaiveNearestTwo(a, i, b);
    if (!passes(forward)) continue;
    double ratio = squared_ratio(forward);
    if (options.cross_check) {
      const NearestTwo backward = NaiveNearestTwo(b, forward.index, a);
      if (!passes(backward) || backward.index != i) continue;
      ratio = std::max(ratio, squared_ratio(backward));
    }
    ranked.emplace_back(ratio, i, forward.index);
  }
  std::sort(ranked.begin(), ranked.end());
  FeatureMatches matches;
  for (const auto& [ratio, i, j] : ranked) matches.push_back({i, j});
  return matches;
}

TEST(EveryTarget, NearestTwoEqualTheNaiveSearch) {
  // Sizes around tiles and blocks; few distinct values, so that many distances tie; the extremes.
  for (const auto& [n1, n2] :
       {std::pair{1, 1}, {1, 40}, {40, 1}, {5, 7}, {12, 32}, {13, 33}, {100, 257}, {259, 140}}) {
    for (const int max_value : {1, 40, 255}) {
      const Descriptors a = RandomDescriptors(n1, n1, max_value);
      Descriptors b = RandomDescriptors(n2, 1000 + n2, max_value);
      if (max_value == 255) b.row(0).setConstant(255);
      ForEachInstructionSet([&, n1 = n1, n2 = n2] {
        std::vector<NearestTwo> of_columns, of_rows;
        FindNearestTwo(a, b, &of_columns, &of_rows);
        ASSERT_EQ(of_columns.size(), static_cast<size_t>(n2));
        ASSERT_EQ(of_rows.size(), static_cast<size_t>(n1));
        for (int j = 0; j < n2; ++j) ASSERT_EQ(of_columns[j], NaiveNearestTwo(b, j, a)) << j;
        for (int i = 0; i < n1; ++i) {
          const NearestTwo expected = NaiveNearestTwo(a, i, b);
          ASSERT_EQ(of_rows[i].best, expected.best) << i;
          ASSERT_EQ(of_rows[i].second, expected.second) << i;
        }
      });
    }
  }
}

TEST(EveryTarget, MatchesEqualTheNaiveOnes) {
  const Descriptors a = RandomDescriptors(150, 1, 120);
  std::vector<int> order;
  for (int i = 149; i >= 0; i -= 2) order.push_back(i);
  order.insert(order.end(), {3, 3, 5, 7});  // Duplicates compete.
  const Descriptors b = Shuffled(a, order, 30);
  for (const bool cross_check : {false, true}) {
    for (const double max_ratio : {0.5, 0.8, 1.0}) {
      const MatchingOptions options{.max_ratio = max_ratio, .cross_check = cross_check};
      const FeatureMatches expected = NaiveMatches(a, b, options);
      EXPECT_THAT(expected, Not(IsEmpty()));
      ForEachInstructionSet([&] { EXPECT_EQ(MatchDescriptors(a, b, options), expected); });
    }
  }
}

// Matches of the features that have a polarity, found among these alone.
FeatureMatches NaiveMatchesOf(uint8_t polarity, const MatchInput& a, const MatchInput& b,
                              const MatchingOptions& options) {
  const auto pick = [&](const MatchInput& image) {
    std::vector<int> rows;
    for (int i = 0; i < image.descriptors.rows(); ++i) {
      if (image.polarities[i] == polarity) rows.push_back(i);
    }
    return rows;
  };
  const std::vector<int> rows_a = pick(a), rows_b = pick(b);
  FeatureMatches matches =
      NaiveMatches(Shuffled(a.descriptors, rows_a, 0), Shuffled(b.descriptors, rows_b, 0), options);
  for (FeatureMatch& match : matches) {
    match = {static_cast<point2D_t>(rows_a[match.point1]),
             static_cast<point2D_t>(rows_b[match.point2])};
  }
  return matches;
}

TEST(EveryTarget, FeaturesMatchWithinTheirPolarityWhereBothImagesHaveIt) {
  const Descriptors a = RandomDescriptors(120, 1, 60);
  std::vector<int> order;
  for (int i = 119; i >= 20; --i) order.push_back(i);
  const Descriptors b = Shuffled(a, order, 25);
  Rng rng(4, "polarities");
  Polarities of_a(120), of_b(100);
  for (uint8_t& polarity : of_a) polarity = static_cast<uint8_t>(rng.UniformInt(2));
  for (size_t j = 0; j < of_b.size(); ++j) of_b[j] = j % 10 == 0 ? !of_a[order[j]] : of_a[order[j]];
  const auto sorted = [](FeatureMatches matches) {
    std::ranges::sort(matches, {}, &FeatureMatch::point1);
    return matches;
  };
  for (const bool cross_check : {false, true}) {
    const MatchingOptions options{.max_ratio = 0.9, .cross_check = cross_check};
    FeatureMatches expected = NaiveMatchesOf(0, {a, of_a}, {b, of_b}, options);
    const FeatureMatches bright = NaiveMatchesOf(1, {a, of_a}, {b, of_b}, options);
    expected.insert(expected.end(), bright.begin(), bright.end());
    EXPECT_GT(expected.size(), 60u);
    ForEachInstructionSet([&] {
      EXPECT_EQ(sorted(MatchDescriptors({a, of_a}, {b, of_b}, options)), sorted(expected));
      EXPECT_EQ(MatchDescriptors({a, {}}, {b, of_b}, options), MatchDescriptors(a, b, options));
      EXPECT_EQ(MatchDescriptors({a, of_a}, {b, {}}, options), MatchDescriptors(a, b, options));
    });
  }
  const Polarities all_bright(120, 1), all_dark(100, 0);
  EXPECT_THAT(MatchDescriptors({a, all_bright}, {b, all_dark}, {}), IsEmpty());
}

TEST(MatchDescriptors, FindsAPermutation) {
  const Descriptors a = RandomDescriptors(200, 3, 120);
  std::vector<int> order(200);
  for (int i = 0; i < 200; ++i) order[i] = (i * 37 + 11) % 200;
  const Descriptors b = Shuffled(a, order, 5);
  const FeatureMatches matches = MatchDescriptors(b, a, {});
  ASSERT_THAT(matches, SizeIs(200));
  std::set<point2D_t> points1;
  for (const FeatureMatch& match : matches) {
    points1.insert(match.point1);
    EXPECT_EQ(match.point2, static_cast<point2D_t>(order[match.point1]));
  }
  EXPECT_THAT(points1, SizeIs(200));
}

TEST(MatchDescriptors, TheMostDistinctiveComeFirst) {
  const Descriptors a = RandomDescriptors(50, 3, 120);
  Descriptors b = a;
  // Later ones are farther from their counterparts.
  for (int i = 0; i < 50; ++i) b(i, 0) = static_cast<uint8_t>(a(i, 0) + 2 * (49 - i));
  const FeatureMatches matches = MatchDescriptors(a, b, {});
  ASSERT_THAT(matches, SizeIs(50));
  int num_in_order = 0;
  for (int k = 1; k < 50; ++k) num_in_order += matches[k - 1].point1 > matches[k].point1;
  EXPECT_GE(num_in_order, 40);
  EXPECT_EQ(matches.front().point1, 49u);
}

TEST(MatchDescriptors, SwappedImagesGiveSwappedMatchesUnderCrossCheck) {
  const Descriptors a = RandomDescriptors(100, 5, 60), b = RandomDescriptors(130, 6, 60);
  const MatchingOptions options{.max_ratio = 1.0, .max_distance = 2.0};
  FeatureMatches forward = MatchDescriptors(a, b, options);
  FeatureMatches backward = MatchDescriptors(b, a, options);
  for (FeatureMatch& match : backward) std::swap(match.point1, match.point2);
  for (FeatureMatches* matches : {&forward, &backward}) {
    std::sort(matches->begin(), matches->end(),
              [](const auto& x, const auto& y) { return x.point1 < y.point1; });
  }
  EXPECT_THAT(forward, Not(IsEmpty()));
  EXPECT_EQ(forward, backward);
}

TEST(MatchDescriptors, EachOptionChangesTheResult) {
  const Descriptors a = RandomDescriptors(200, 8, 60);
  std::vector<int> order(200);
  for (int i = 0; i < 200; ++i) order[i] = i / 2;
  const Descriptors b = Shuffled(a, order, 12);
  const MatchingOptions loose{.max_ratio = 1.0, .max_distance = 2.0, .cross_check = false};
  const size_t num_loose = MatchDescriptors(a, b, loose).size();
  MatchingOptions options = loose;
  options.max_ratio = 0.9;
  EXPECT_LT(MatchDescriptors(a, b, options).size(), num_loose);
  options = loose;
  options.max_distance = 0.3;
  EXPECT_LT(MatchDescriptors(a, b, options).size(), num_loose);
  options = loose;
  options.cross_check = true;
  EXPECT_LT(MatchDescriptors(a, b, options).size(), num_loose);
}

TEST(MatchDescriptors, DuplicatesAreAmbiguousAndALonelyNeighborIsNot) {
  Descriptors a = RandomDescriptors(1, 9), b(2, 128);
  b.row(0) = a.row(0);
  b.row(1) = a.row(0);
  EXPECT_THAT(MatchDescriptors(a, b, {}), IsEmpty());
  EXPECT_THAT(MatchDescriptors(a, a, {}), SizeIs(1));
}

TEST(MatchDescriptors, EmptyImagesHaveNoMatches) {
  const Descriptors none(0, 128), some = RandomDescriptors(10, 2);
  for (const bool cross_check : {false, true}) {
    const MatchingOptions options{.cross_check = cross_check};
    EXPECT_THAT(MatchDescriptors(none, some, options), IsEmpty());
    EXPECT_THAT(MatchDescriptors(some, none, options), IsEmpty());
    EXPECT_THAT(MatchDescriptors(Descriptors(), Descriptors(), options), IsEmpty());
  }
}

TEST(MatchDescriptors, OtherDimensionsAreABug) {
  const Descriptors other = Descriptors::Zero(3, 64);
  EXPECT_THROW(MatchDescriptors(other, other, {}), BugError);
}

TEST(MatchingOptions, AreValidated) {
  const Descriptors none(0, 128);
  EXPECT_NO_THROW(MatchDescriptors(none, none, {}));
  EXPECT_THROW(MatchDescriptors(none, none, {.max_ratio = 1.5}), ConfigError);
}

}  // namespace
}  // namespace cairn
