#include "view_graph/loose_group.h"

#include <algorithm>
#include <map>
#include <optional>
#include <vector>

#include "cairn/base/parallel.h"
#include "view_graph/shared_view.h"

namespace cairn {
namespace {

// Pairs between two groups that tell.
constexpr int kMinPairs = 6;
// What lies behind all that an image sees there may be hidden.
constexpr double kHiddenBehind = 1.25;

// What images should see of each other's points, and what they do.
struct Shared {
  int64_t expected = 0, common = 0;
  int num_pairs = 0;

  double Rate() const { return static_cast<double>(common) / static_cast<double>(expected); }
  Shared& operator+=(const Shared& other) {
    expected += other.expected;
    common += other.common;
    num_pairs += other.num_pairs;
    return *this;
  }
};

// Points of `a` that `b` should see.
Shared SharedInto(const View& a, const View& b) {
  Shared shared;
  for (const auto& [id, xyz] : a.samples) {
    const std::optional<Expected> expected = ExpectIn(b, a, xyz);
    if (!expected || expected->distance > kHiddenBehind * b.farthest[expected->cell]) continue;
    ++shared.expected;
    shared.common += b.Sees(id);
  }
  return shared;
}

// None: too few points tell.
Shared SharedOf(const View& a, const View& b) {
  Shared shared = SharedInto(a, b);
  if (shared.expected < kMinComparable) return {};
  const Shared back = SharedInto(b, a);
  if (back.expected < kMinComparable) return {};
  shared += back;
  shared.num_pairs = 1;
  return shared;
}

// Average linkage by chains of nearest neighbors (Benzécri 1982): the share of two groups taken
// together with a third lies between theirs, so that neighbors stay neighbors.
class Linkage {
 public:
  explicit Linkage(size_t num_images) : images_(num_images), within_(num_images), to_(num_images) {
    for (size_t i = 0; i < num_images; ++i) images_[i] = {static_cast<int>(i)};
  }
  void Add(int image1, int image2, const Shared& shared) {
    to_[image1][image2] = to_[image2][image1] = shared;
  }

  struct Join {
    std::vector<int> images, others;
    double relative_rate = 1;
  };
  // The join of the lowest relative rate.
  Join Lowest() {
    Join lowest;
    for (size_t i = 0; i < to_.size(); ++i) {
      std::vector<int> chain = {static_cast<int>(i)};
      while (!chain.empty()) {
        const std::optional<int> next = Nearest(chain.back());
        if (!next) {
          chain.pop_back();
        } else if (chain.size() > 1 && *next == chain[chain.size() - 2]) {
          const int group = chain.back();
          chain.resize(chain.size() - 2);
          Judge(group, *next, lowest);
          const int merged = Merge(group, *next);
          if (chain.empty()) chain.push_back(merged);
        } else {
          chain.push_back(*next);
        }
      }
    }
    return lowest;
  }

 private:
  // Of equal ones that of the smallest index, so that no chain goes round.
  std::optional<int> Nearest(int group) const {
    std::optional<int> nearest;
    for (const auto& [other, shared] : to_[group]) {
      if (!nearest || shared.Rate() > to_[group].at(*nearest).Rate()) nearest = other;
    }
    return nearest;
  }

  void Judge(int group, int other, Join& lowest) const {
    const Shared& across = to_[group].at(other);
    if (std::ssize(images_[group]) < kMinGroup || std::ssize(images_[other]) < kMinGroup) return;
    if (across.num_pairs < kMinPairs) return;
    const double within = std::min(within_[group].Rate(), within_[other].Rate());
    if (across.Rate() >= lowest.relative_rate * within) return;
    lowest = {images_[group], images_[other], across.Rate() / within};
    if (lowest.images.size() > lowest.others.size()) std::swap(lowest.images, lowest.others);
  }

  // The group that is left.
  int Merge(int group, int other) {
    if (to_[group].size() < to_[other].size()) std::swap(group, other);
    within_[group] += within_[other];
    within_[group] += to_[group].at(other);
    images_[group].insert(images_[group].end(), images_[other].begin(), images_[other].end());
    for (const auto& [third, shared] : std::exchange(to_[other], {})) {
      to_[third].erase(other);
      if (third == group) continue;
      to_[group][third] += shared;
      to_[third][group] = to_[group][third];
    }
    return group;
  }

  std::vector<std::vector<int>> images_;   // by group
  std::vector<Shared> within_;             // by group
  std::vector<std::map<int, Shared>> to_;  // by group and group
};

}  // namespace

LooseGroup FindLooseGroup(const Reconstruction& model, std::span<const image_pair_t> tried,
                          const RunContext& run) {
  const Views all = MakeViews(model, run.num_threads);
  std::vector<std::pair<int, int>> pairs;
  for (const image_pair_t pair : tried) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    if (const auto images = all.Find(id1, id2)) pairs.push_back(*images);
  }
  std::vector<Shared> shared(pairs.size());
  ParallelFor(run.num_threads, std::ssize(pairs), [&](int64_t k) {
    shared[k] = SharedOf(all.views[pairs[k].first], all.views[pairs[k].second]);
  });
  Linkage linkage(all.ids.size());
  for (size_t k = 0; k < pairs.size(); ++k) {
    if (shared[k].num_pairs > 0) linkage.Add(pairs[k].first, pairs[k].second, shared[k]);
  }
  const Linkage::Join lowest = linkage.Lowest();
  LooseGroup group;
  group.relative_rate = lowest.relative_rate;
  for (const int i : lowest.images) group.images.insert(all.ids[i]);
  for (const int i : lowest.others) group.others.insert(all.ids[i]);
  return group;
}

}  // namespace cairn
