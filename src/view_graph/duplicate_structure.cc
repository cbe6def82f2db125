#include "view_graph/duplicate_structure.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "cairn/base/parallel.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "math/sorted_order.h"
#include "view_graph/shared_view.h"

namespace cairn {
namespace {

// A pair contradicts where more of them lie in cells without any match than its matching rate
// explains, by this many standard deviations.
constexpr double kMinDeviations = 1;

// What two views show of each other: the more comparable points, the more it counts.
struct Comparison {
  double evidence = 0;
  double conflict = 0;  // share of the evidence, 0 to 1, beyond what is expected
  double sigma = 0;     // standard deviation that is expected of it
};

// The rate at which expected points are matched, from cells that have a match (binomial without
// zero: a cell of n points has n rate / (1 - (1 - rate)^n) matches on average).
double MatchingRate(const std::vector<std::pair<int, int>>& matched) {
  double common = 0;
  for (const auto& [n, c] : matched) common += c;
  double rate = 0.95;
  for (int iteration = 0; iteration < 30; ++iteration) {
    double expected = 0;
    for (const auto& [n, c] : matched) {
      expected += n / std::max(1e-6, 1 - std::pow(1 - rate, n));
    }
    const double next = std::min(0.95, common / expected);
    if (next == std::exchange(rate, next)) break;
  }
  return rate;
}

// The chance that of n points of a cell none is matched. Cells have rates of their own, by a Beta
// law with the pair's mean and precision 1: a pair that matches badly (another light, another
// season, blur) does so in patches.
double ChanceOfNone(double rate, int n) {
  double chance = 1;
  for (int k = 0; k < n; ++k) chance *= (1 - rate + k) / (1.0 + k);
  return chance;
}

// Points of `a` that `b` should see as well, against those that it does, cell by cell. A pair that
// matches badly misses points everywhere; one of two places that look alike matches in some cells
// as well as any, and in others, where both have points, not at all.
Comparison CompareInto(const View& a, const View& b) {
  struct Cell {
    int expected = 0, present = 0, common = 0;
  };
  std::vector<Cell> cells(b.present.size());
  for (size_t k = 0; k < cells.size(); ++k) cells[k].present = b.present[k];
  for (const auto& [id, xyz] : a.samples) {
    const std::optional<Expected> expected = ExpectIn(b, a, xyz);
    if (!expected) continue;
    ++cells[expected->cell].expected;
    cells[expected->cell].common += b.Sees(id);
  }
  std::vector<std::pair<int, int>> matched;  // expected and common points of cells with matches
  for (const Cell& cell : cells) {
    if (cell.common > 0) matched.emplace_back(cell.expected, cell.common);
  }
  Comparison result;
  if (matched.empty()) return result;
  // A cell without matches is no surprise where few are expected.
  const double rate = MatchingRate(matched);
  double variance = 0;
  for (const Cell& cell : cells) {
    const int weight = std::min(cell.expected, cell.present);
    const double chance = ChanceOfNone(rate, weight);
    result.evidence += weight;
    result.conflict += weight * ((cell.common == 0 ? 1.0 : 0.0) - chance);
    variance += weight * weight * chance * (1 - chance);
  }
  if (result.evidence > 0) {
    result.conflict = std::max(0.0, result.conflict / result.evidence);
    result.sigma = std::sqrt(variance) / result.evidence;
  }
  return result;
}

Comparison Compare(const View& a, const View& b) {
  const Comparison ab = CompareInto(a, b);
  const Comparison ba = CompareInto(b, a);
  return {std::min(ab.evidence, ba.evidence), std::min(ab.conflict, ba.conflict),
          std::max(ab.sigma, ba.sigma)};
}

// A pair of registered images, by their indices.
struct Pair {
  size_t edge = 0;  // in the graph
  int image1 = 0, image2 = 0;
  int num_inliers = 0;
  double angle_deg = 0;  // between the two orientations
  Comparison comparison;

  bool CanTell() const { return comparison.evidence >= kMinComparable; }
  // +1: they look at one place, -1: at two, 0: they do not show enough in common to tell.
  int Vote() const {
    if (!CanTell()) return 0;
    return comparison.conflict > kMinDeviations * comparison.sigma ? -1 : 1;
  }
};

std::vector<Pair> ComparePairs(const Reconstruction& model, const ViewGraph& graph,
                               int num_threads) {
  const Views all = MakeViews(model, num_threads);
  std::vector<Pair> pairs;
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    const ViewEdge& edge = graph.edges[e];
    const auto images = all.Find(edge.image_id1, edge.image_id2);
    if (!edge.IsActive() || !images) continue;
    const double angle = AngleBetween(model.images.at(edge.image_id1).cam_from_world.rotation,
                                      model.images.at(edge.image_id2).cam_from_world.rotation);
    pairs.push_back({e, images->first, images->second, edge.num_inliers, RadToDeg(angle), {}});
  }
  ParallelFor(num_threads, static_cast<int64_t>(pairs.size()), [&](int64_t i) {
    pairs[i].comparison = Compare(all.views[pairs[i].image1], all.views[pairs[i].image2]);
  });
  return pairs;
}

// Groups of images, joined along the pairs that do not contradict, those of most matches first, but
// not where more of the pairs between two groups see two places than see one.
class Groups {
 public:
  Groups(int num_images, const std::vector<Pair>& pairs)
      : pairs_(pairs), pairs_of_(num_images), group_of_(num_images), members_(num_images) {
    for (size_t k = 0; k < pairs.size(); ++k) {
      pairs_of_[pairs[k].image1].push_back(static_cast<int>(k));
      pairs_of_[pairs[k].image2].push_back(static_cast<int>(k));
    }
    for (int i = 0; i < num_images; ++i) {
      group_of_[i] = i;
      members_[i] = {i};
    }
    JoinAlongPairs();
    // An image or two that fit nowhere are not a place: they go where most of their matches lead.
    for (int group = 0; group < num_images; ++group) {
      if (SizeOf(group) > 0 && SizeOf(group) < kMinGroup) Dissolve(group);
    }
  }

  int Of(int image) const { return group_of_[image]; }
  // By their index.
  const std::vector<int>& PairsOf(int image) const { return pairs_of_[image]; }
  int OtherImage(int pair, int image) const {
    return pairs_[pair].image1 == image ? pairs_[pair].image2 : pairs_[pair].image1;
  }
  int SizeOf(int group) const { return static_cast<int>(members_[group].size()); }
  // Joins the group to the one that most of its matches lead to. False: none do.
  bool Dissolve(int group) {
    std::map<int, int64_t> num_matches;
    for (const int i : members_[group]) {
      for (const int k : pairs_of_[i]) {
        const int other = Of(OtherImage(k, i));
        if (other != group) num_matches[other] += pairs_[k].num_inliers;
      }
    }
    if (num_matches.empty()) return false;
    Join(std::ranges::max_element(num_matches, {}, [](auto& entry) { return entry.second; })->first,
         group);
    return true;
  }

 private:
  void JoinAlongPairs() {
    using TwoGroups = std::pair<int, int>;
    std::map<TwoGroups, TwoGroups> refused_at;  // sizes: groups change only as they grow
    const auto key = [&](int k) {
      return std::make_pair(pairs_[k].Vote() < 0, -pairs_[k].num_inliers);
    };
    for (const int k : SortedOrder(pairs_.size(), key)) {
      int group1 = Of(pairs_[k].image1), group2 = Of(pairs_[k].image2);
      if (group1 == group2) continue;
      if (SizeOf(group1) < SizeOf(group2)) std::swap(group1, group2);
      const TwoGroups sizes(SizeOf(group1), SizeOf(group2));
      TwoGroups& refused = refused_at[{group1, group2}];
      if (refused == sizes) continue;
      if (Balance(group2, group1) >= 0) {
        Join(group1, group2);
      } else {
        refused = sizes;
      }
    }
  }

  // Votes of the pairs between two groups, the first of them the smaller one.
  int Balance(int group, int other) const {
    int balance = 0;
    for (const int i : members_[group]) {
      for (const int k : pairs_of_[i]) {
        if (Of(OtherImage(k, i)) == other) balance += pairs_[k].Vote();
      }
    }
    return balance;
  }

  void Join(int into, int group) {
    for (const int i : members_[group]) group_of_[i] = into;
    members_[into].insert(members_[into].end(), members_[group].begin(), members_[group].end());
    members_[group].clear();
  }

  const std::vector<Pair>& pairs_;
  std::vector<std::vector<int>> pairs_of_;  // by image
  std::vector<int> group_of_;               // by image
  std::vector<std::vector<int>> members_;   // by group
};

// How much views of one place conflict, too: by occlusion, blur, what moves; the more, the farther
// apart they are. Learned from the pairs within the groups.
class UsualConflict {
 public:
  UsualConflict(const std::vector<Pair>& pairs, const Groups& groups) {
    std::vector<double> all, evidence;
    std::array<std::vector<double>, kNumBins> of_bin;
    for (const Pair& pair : pairs) {
      if (!pair.CanTell() || groups.Of(pair.image1) != groups.Of(pair.image2)) continue;
      all.push_back(pair.comparison.conflict);
      of_bin[Bin(pair)].push_back(pair.comparison.conflict);
      evidence.push_back(pair.comparison.evidence);
    }
    // Less than a point cannot be seen.
    const double least = evidence.empty() ? 1.0 : 1.0 / UpperMedian(evidence);
    for (int bin = 0; bin < kNumBins; ++bin) {
      const bool is_enough = of_bin[bin].size() >= kMinPairs;
      median_[bin] = std::max(least, UpperMedian(is_enough ? of_bin[bin] : all));
    }
  }

  // -log of the chance that a pair of one place conflicts so much: a law with this median whose
  // tail falls with the square, slower than exponentially, as those of photographs do.
  double Surprise(const Pair& pair) const {
    const double scale = median_[Bin(pair)] / (std::sqrt(2.0) - 1);
    return 2 * std::log1p(pair.comparison.conflict / scale);
  }

 private:
  static constexpr int kNumBins = 4;  // of ten degrees, the last one open
  static constexpr size_t kMinPairs = 5;
  static int Bin(const Pair& pair) {
    return std::min(kNumBins - 1, static_cast<int>(pair.angle_deg / 10));
  }
  std::array<double, kNumBins> median_;
};

// The pairs that lead out of a group.
struct Border {
  int num_inside = 0, num_outside = 0;  // images
  double surprise = 0;
  int num_pairs = 0;
};

// By group.
std::vector<Border> BordersOf(const std::vector<Pair>& pairs, int num_images,
                              const Groups& groups) {
  const UsualConflict usual(pairs, groups);
  std::vector<Border> borders(num_images);
  const auto leads_out = [&](const Pair& pair) {
    return pair.CanTell() && groups.Of(pair.image1) != groups.Of(pair.image2);
  };
  for (const Pair& pair : pairs) {
    if (!leads_out(pair)) continue;
    const double surprise = usual.Surprise(pair);
    for (const int image : {pair.image1, pair.image2}) {
      Border& border = borders[groups.Of(image)];
      border.surprise += surprise;
      ++border.num_pairs;
    }
  }
  std::vector<int> seen_from(num_images, -1);  // of each group the last image with a pair into it
  for (int i = 0; i < num_images; ++i) {
    bool is_inside = false;
    for (const int k : groups.PairsOf(i)) {
      if (!leads_out(pairs[k])) continue;
      is_inside = true;
      const int other = groups.Of(groups.OtherImage(k, i));
      if (std::exchange(seen_from[other], i) != i) ++borders[other].num_outside;
    }
    borders[groups.Of(i)].num_inside += is_inside;
  }
  return borders;
}

// The evidence, nats, that a group of images shows another place than those it has pairs with, less
// what it takes to name the group among all others of its size. Under one place, the surprises of
// its pairs with others are exponential with mean 1; under two, with the mean that they have. Pairs
// of one image hang together: no more of them count than there are images, twice for the two sides.
double SplitEvidence(const Border& border, int size, int num_images) {
  double cost = 0;
  for (int k = 1; k <= size; ++k) cost += std::log(double(num_images - size + k) / k);
  const double mean = border.num_pairs > 0 ? border.surprise / border.num_pairs : 0;
  if (mean <= 1) return -cost;
  const int num_independent =
      std::min(border.num_pairs, 2 * std::min(border.num_inside, border.num_outside));
  return num_independent * (mean - 1 - std::log(mean)) - cost;
}

// Dissolves the groups without support, the least supported first.
void KeepProven(const std::vector<Pair>& pairs, int num_images, Groups& groups) {
  std::set<int> alone;  // no pair leads out of them
  for (;;) {
    const std::vector<Border> borders = BordersOf(pairs, num_images, groups);
    std::map<int, double> evidence;
    for (int i = 0; i < num_images; ++i) {
      const int group = groups.Of(i);
      if (evidence.contains(group) || alone.contains(group)) continue;
      if (groups.SizeOf(group) == num_images) return;
      evidence[group] = SplitEvidence(borders[group], groups.SizeOf(group), num_images);
    }
    const auto least =
        std::ranges::min_element(evidence, {}, [](auto& entry) { return entry.second; });
    if (least == evidence.end() || least->second > 0) return;
    if (!groups.Dissolve(least->first)) alone.insert(least->first);
  }
}

}  // namespace

DuplicateStructure FindDuplicateStructure(const Reconstruction& model, const ViewGraph& graph,
                                          const RunContext& run) {
  const std::vector<Pair> pairs = ComparePairs(model, graph, run.num_threads);
  Groups groups(static_cast<int>(model.images.size()), pairs);
  KeepProven(pairs, static_cast<int>(model.images.size()), groups);
  DuplicateStructure found;
  std::set<image_t> conflicting;
  for (const Pair& pair : pairs) {
    const ViewEdge& edge = graph.edges[pair.edge];
    if (groups.Of(pair.image1) != groups.Of(pair.image2)) found.edges.push_back(pair.edge);
    found.num_told += pair.CanTell();
    if (pair.Vote() >= 0) continue;
    ++found.num_conflicting;
    conflicting.insert({edge.image_id1, edge.image_id2});
  }
  found.images.assign(conflicting.begin(), conflicting.end());
  return found;
}

}  // namespace cairn
