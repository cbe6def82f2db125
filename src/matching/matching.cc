#include "cairn/matching/matching.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "cairn/base/check.h"
#include "matching/nearest_two.h"

namespace cairn {
namespace {

constexpr int kDim = 128;
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

PreparedDescriptors::PreparedDescriptors(const Descriptors& descriptors)
    : size_(static_cast<int>(descriptors.rows())) {
  CAIRN_CHECK(descriptors.cols() == kDim || descriptors.rows() == 0);
  data_.assign(descriptors.data(), descriptors.data() + descriptors.size());
  squared_norms_.resize(size_);
  for (int i = 0; i < size_; ++i) {
    for (int k = 0; k < kDim; ++k) squared_norms_[i] += Row(i)[k] * Row(i)[k];
  }
}

FeatureMatches MatchDescriptors(const PreparedDescriptors& descriptors1,
                                const PreparedDescriptors& descriptors2,
                                const MatchingOptions& options) {
  ValidateOptions(options, "matching");
  std::vector<RankedMatch> ranked;
  if (!options.cross_check) {
    std::vector<NearestTwo> nearest;
    FindNearestTwo(descriptors2, descriptors1, &nearest, nullptr);
    for (point2D_t i = 0; i < nearest.size(); ++i) {
      if (!Passes(nearest[i], options)) continue;
      ranked.push_back({SquaredRatio(nearest[i]), {i, static_cast<point2D_t>(nearest[i].index)}});
    }
    return BestFirst(std::move(ranked));
  }
  std::vector<NearestTwo> nearest1, nearest2;
  FindNearestTwo(descriptors1, descriptors2, &nearest2, &nearest1);
  // A passing row has one nearest column alone (a tie fails the ratio test), so equal distances
  // mean that the two are each other's nearest.
  std::vector<point2D_t> match_of(nearest1.size(), kInvalidPoint2D);
  for (point2D_t j = 0; j < nearest2.size(); ++j) {
    if (!Passes(nearest2[j], options)) continue;
    const int i = nearest2[j].index;
    if (Passes(nearest1[i], options) && nearest1[i].best == nearest2[j].best) match_of[i] = j;
  }
  for (point2D_t i = 0; i < match_of.size(); ++i) {
    const point2D_t j = match_of[i];
    if (j == kInvalidPoint2D) continue;
    ranked.push_back({std::max(SquaredRatio(nearest1[i]), SquaredRatio(nearest2[j])), {i, j}});
  }
  return BestFirst(std::move(ranked));
}

FeatureMatches MatchDescriptors(const Descriptors& descriptors1, const Descriptors& descriptors2,
                                const MatchingOptions& options) {
  return MatchDescriptors(PreparedDescriptors(descriptors1), PreparedDescriptors(descriptors2),
                          options);
}

}  // namespace cairn
