#include "cairn/matching/matching.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "cairn/base/check.h"
#include "matching/nearest_two.h"

namespace cairn {
namespace {

constexpr double kUnitLength = 512.0;  // of a descriptor as stored

bool Passes(const NearestTwo& nearest, const MatchingOptions& options) {
  if (nearest.best == kNoNeighbor) return false;
  const double max_distance = options.max_distance * kUnitLength;
  if (nearest.best > max_distance * max_distance) return false;
  if (nearest.second == kNoNeighbor) return true;
  return nearest.best < options.max_ratio * options.max_ratio * nearest.second;
}

// The square of the ratio; 0 without a second neighbour.
double SquaredRatio(const NearestTwo& nearest) {
  return nearest.second == kNoNeighbor ? 0.0 : static_cast<double>(nearest.best) / nearest.second;
}

struct RankedMatch {
  double squared_ratio;
  FeatureMatch match;
};

FeatureMatches BestFirst(std::vector<RankedMatch> ranked) {
  std::sort(ranked.begin(), ranked.end(), [](const RankedMatch& a, const RankedMatch& b) {
    return std::tie(a.squared_ratio, a.match.point1) < std::tie(b.squared_ratio, b.match.point1);
  });
  FeatureMatches matches;
  matches.reserve(ranked.size());
  for (const RankedMatch& r : ranked) matches.push_back(r.match);
  return matches;
}

}  // namespace

FeatureMatches MatchDescriptors(const Descriptors& descriptors1, const Descriptors& descriptors2,
                                const MatchingOptions& options) {
  ValidateOptions(options, "matching");
  std::vector<NearestTwo> nearest1, nearest2;
  FindNearestTwo(descriptors2, descriptors1, &nearest1, &nearest2);
  std::vector<RankedMatch> ranked;
  for (point2D_t i = 0; i < nearest1.size(); ++i) {
    if (!Passes(nearest1[i], options)) continue;
    const auto j = static_cast<point2D_t>(nearest1[i].index);
    double squared_ratio = SquaredRatio(nearest1[i]);
    if (options.cross_check) {
      // What passes has one nearest neighbor alone (a tie fails the ratio test), so equal distances
      // mean that the two are each other's nearest.
      if (!Passes(nearest2[j], options) || nearest2[j].best != nearest1[i].best) continue;
      squared_ratio = std::max(squared_ratio, SquaredRatio(nearest2[j]));
    }
    ranked.push_back({squared_ratio, {i, j}});
  }
  return BestFirst(std::move(ranked));
}

}  // namespace cairn
