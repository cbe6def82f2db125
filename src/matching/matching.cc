#include "cairn/matching/matching.h"

#include <algorithm>
#include <tuple>
#include <utility>

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

// The descriptors of an image's features of one polarity.
struct PickedRows {
  std::vector<int> index;
  Descriptors descriptors;

  PickedRows(const MatchInput& image, uint8_t polarity) {
    for (size_t i = 0; i < image.polarities.size(); ++i) {
      if (image.polarities[i] == polarity) index.push_back(static_cast<int>(i));
    }
    descriptors.resize(std::ssize(index), image.descriptors.cols());
    for (size_t k = 0; k < index.size(); ++k) {
      descriptors.row(static_cast<Eigen::Index>(k)) = image.descriptors.row(index[k]);
    }
  }
};

// FindNearestTwo among the features of the same polarity; indices are those of all features.
void FindNearestOfSamePolarity(const MatchInput& image1, const MatchInput& image2,
                               std::vector<NearestTwo>* nearest1,
                               std::vector<NearestTwo>* nearest2) {
  nearest1->assign(image1.polarities.size(), {});
  nearest2->assign(image2.polarities.size(), {});
  for (const uint8_t polarity : {0, 1}) {
    const PickedRows picked1(image1, polarity), picked2(image2, polarity);
    std::vector<NearestTwo> of1, of2;
    FindNearestTwo(picked2.descriptors, picked1.descriptors, &of1, &of2);
    for (size_t k = 0; k < of1.size(); ++k) {
      if (of1[k].index >= 0) of1[k].index = picked2.index[of1[k].index];
      (*nearest1)[picked1.index[k]] = of1[k];
    }
    for (size_t k = 0; k < of2.size(); ++k) (*nearest2)[picked2.index[k]] = of2[k];
  }
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

FeatureMatches MatchDescriptors(const MatchInput& image1, const MatchInput& image2,
                                const MatchingOptions& options) {
  ValidateOptions(options, "matching");
  std::vector<NearestTwo> nearest1, nearest2;
  if (image1.polarities.empty() || image2.polarities.empty()) {
    FindNearestTwo(image2.descriptors, image1.descriptors, &nearest1, &nearest2);
  } else {
    FindNearestOfSamePolarity(image1, image2, &nearest1, &nearest2);
  }
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
