#include "cairn/tracks/tracks.h"

#include <algorithm>
#include <atomic>
#include <limits>
#include <tuple>
#include <unordered_map>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "graph/union_find.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

constexpr size_t kLookahead = 16;  // matches; some ten lookups fit into one wait for memory
// Matches that are looked up in parallel before some of them join sets, one after the other.
constexpr size_t kMatchesAtATime = size_t{1} << 18;

using NodePair = std::pair<int, int>;

// Keypoints that are matched, as consecutive nodes, ordered by (image, keypoint), so that node
// order is element order.
class Nodes {
 public:
  explicit Nodes(std::span<const PairMatches> pairs, int num_threads) {
    MarkMatched(pairs, num_threads);
    size_t num = 0;
    for (const auto& [image_id, marks] : node_of_) num += std::ranges::count(marks, 0);
    CAIRN_CHECK_LE(num, static_cast<size_t>(std::numeric_limits<int>::max()));
    elements_.reserve(num);
    for (auto& [image_id, marks] : node_of_) {
      for (size_t point = 0; point < marks.size(); ++point) {
        if (marks[point] < 0) continue;
        marks[point] = static_cast<int>(elements_.size());
        elements_.push_back({image_id, static_cast<point2D_t>(point)});
      }
    }
  }

  int Num() const { return static_cast<int>(elements_.size()); }
  const TrackElement& Element(int node) const { return elements_[node]; }
  image_t ImageOf(int node) const { return elements_[node].image_id; }
  // The pair's matches as pairs of nodes, sorted.
  std::vector<NodePair> MatchesOf(const PairMatches& pair) const {
    std::vector<NodePair> matches;
    if (pair.matches.empty()) return matches;
    const std::vector<int>& nodes1 = node_of_.at(pair.image_id1);
    const std::vector<int>& nodes2 = node_of_.at(pair.image_id2);
    matches.reserve(pair.matches.size());
    for (const FeatureMatch& match : pair.matches) {
      matches.emplace_back(std::minmax(nodes1[match.point1], nodes2[match.point2]));
    }
    if (!std::is_sorted(matches.begin(), matches.end())) std::sort(matches.begin(), matches.end());
    return matches;
  }

 private:
  // A pair's matches, of one of its images.
  struct Side {
    const PairMatches* pair;
    point2D_t FeatureMatch::*point;
  };

  void MarkMatched(std::span<const PairMatches> pairs, int num_threads) {
    std::map<image_t, std::vector<Side>> sides_of;
    for (const PairMatches& pair : pairs) {
      CAIRN_CHECK_NE(pair.image_id1, pair.image_id2);
      if (pair.matches.empty()) continue;
      sides_of[pair.image_id1].push_back({&pair, &FeatureMatch::point1});
      sides_of[pair.image_id2].push_back({&pair, &FeatureMatch::point2});
    }
    std::vector<std::pair<std::vector<int>*, std::vector<Side>>> images;
    for (auto& [id, sides] : sides_of) images.emplace_back(&node_of_[id], std::move(sides));
    ParallelFor(num_threads, std::ssize(images), [&](int64_t i) {
      auto& [marks, sides] = images[i];
      for (const Side& side : sides) {
        for (const FeatureMatch& match : side.pair->matches) {
          const point2D_t point = match.*side.point;
          if (marks->size() <= point) marks->resize(point + 1, -1);
          (*marks)[point] = 0;
        }
      }
    });
  }

  std::vector<TrackElement> elements_;
  std::map<image_t, std::vector<int>> node_of_;  // by keypoint; -1: not matched
};

// Pairs by falling support; the images break ties, so that the order given does not matter.
std::vector<int> OrderBySupport(std::span<const PairMatches> pairs) {
  return SortedOrder(pairs.size(), [&](int i) {
    return std::make_tuple(-std::ssize(pairs[i].matches), pairs[i].image_id1, pairs[i].image_id2);
  });
}

// A node and its image. Ascending nodes have ascending images.
using ImageNode = std::pair<image_t, int>;

// Disjoint sets of nodes. Most are short, each a list in ascending order that begins at its root;
// what a walk along a list reads of a node lies together: members are far apart, and each costs a
// wait for memory. So a set that grows long becomes an array.
class NodeSets {
 public:
  explicit NodeSets(const Nodes& nodes) : members_(nodes.Num()) {
    for (int node = 0; node < nodes.Num(); ++node) {
      members_[node] = {.parent = node, .next = -1, .image_id = nodes.ImageOf(node), .set_size = 1};
    }
  }

  // Threads may ask at the same time, while none joins.
  int Root(int node) {
    return FindRoot(node, [this](int n) { return ParentOf(n); });
  }
  // Has memory load what Root(node) will read.
  void Prefetch(int node) {
    __builtin_prefetch(&members_[ParentOf(node).load(std::memory_order_relaxed)]);
  }
  bool IsRoot(int node) const { return members_[node].parent == node; }
  int SizeOf(int root) const { return members_[root].set_size; }
  // Calls fn(image, node) for all members in ascending order, until it returns true.
  template <class Fn>
  bool AnyMember(int root, const Fn& fn) const {
    if (IsLong(root)) {
      for (const auto& [image_id, node] : long_sets_.at(root)) {
        if (fn(image_id, node)) return true;
      }
      return false;
    }
    for (int node = root; node >= 0; node = members_[node].next) {
      if (fn(members_[node].image_id, node)) return true;
    }
    return false;
  }
  bool ShareImage(int root1, int root2) const {
    if (SizeOf(root1) < SizeOf(root2)) std::swap(root1, root2);
    if (!IsLong(root1)) return ShortOnesShareImage(root1, root2);
    const std::vector<ImageNode>& first = long_sets_.at(root1);
    auto from = first.begin();
    return AnyMember(root2, [&](image_t image_id, int) {
      from = std::lower_bound(from, first.end(), ImageNode(image_id, 0));
      return from != first.end() && from->first == image_id;
    });
  }
  void Join(int root1, int root2) {
    if (root1 > root2) std::swap(root1, root2);
    const int size = SizeOf(root1) + SizeOf(root2);
    if (size < kLong) {
      MergeLists(root1, root2);
    } else {
      std::vector<ImageNode> members = TakeMembers(root1), others = TakeMembers(root2);
      if (members.size() < others.size()) members.swap(others);
      for (const ImageNode& other : others) {
        members.insert(std::ranges::lower_bound(members, other), other);
      }
      long_sets_[root1] = std::move(members);
    }
    members_[root2].parent = root1;
    members_[root1].set_size = size;
  }

 private:
  static constexpr int kLong = 64;

  struct Member {
    int parent;
    int next;  // -1: the last one; means nothing in a long set
    image_t image_id;
    int set_size;  // of a root's set
  };
  std::atomic_ref<int> ParentOf(int node) { return std::atomic_ref<int>(members_[node].parent); }
  bool IsLong(int root) const { return SizeOf(root) >= kLong; }

  bool ShortOnesShareImage(int root1, int root2) const {
    for (int a = root1, b = root2; a >= 0 && b >= 0;) {
      const image_t image1 = members_[a].image_id;
      const image_t image2 = members_[b].image_id;
      if (image1 == image2) return true;
      int& behind = image1 < image2 ? a : b;
      behind = members_[behind].next;
    }
    return false;
  }
  // Of short sets, the smaller root first.
  void MergeLists(int root1, int root2) {
    int last = root1, a = members_[root1].next, b = root2;
    while (a >= 0 && b >= 0) {
      int& smaller = a < b ? a : b;
      last = members_[last].next = smaller;
      smaller = members_[smaller].next;
    }
    members_[last].next = a >= 0 ? a : b;
  }
  // Leaves none of a long set.
  std::vector<ImageNode> TakeMembers(int root) {
    if (IsLong(root)) return std::move(long_sets_.extract(root).mapped());
    std::vector<ImageNode> members;
    AnyMember(root, [&](image_t image_id, int node) {
      members.emplace_back(image_id, node);
      return false;
    });
    return members;
  }

  std::vector<Member> members_;
  std::unordered_map<int, std::vector<ImageNode>> long_sets_;  // by root; ascending
};

// Matches of a pair, as roots, that would join two sets.
struct OpenMatches {
  std::vector<NodePair> roots;
  int64_t num_conflicting = 0;
};

// Sets that share an image share one for good: only what is open can join sets later.
OpenMatches FindOpenMatches(NodeSets& sets, const std::vector<NodePair>& matches) {
  OpenMatches open;
  for (size_t m = 0; m < matches.size(); ++m) {
    if (m + kLookahead < matches.size()) {
      sets.Prefetch(matches[m + kLookahead].first);
      sets.Prefetch(matches[m + kLookahead].second);
    }
    const int root1 = sets.Root(matches[m].first);
    const int root2 = sets.Root(matches[m].second);
    if (root1 == root2) continue;
    if (sets.ShareImage(root1, root2)) {
      ++open.num_conflicting;
    } else {
      open.roots.emplace_back(root1, root2);
    }
  }
  return open;
}

// Joins the sets of the nodes that are matched, pair by pair in this order. Returns how many
// matches are left out, since they would join two keypoints of an image.
int64_t JoinMatches(std::span<const PairMatches> pairs, const std::vector<int>& order,
                    const Nodes& nodes, int num_threads, NodeSets& sets) {
  int64_t num_conflicting = 0;
  for (auto begin = order.begin(), end = begin; begin != order.end(); begin = end) {
    for (size_t num = 0; end != order.end() && num < kMatchesAtATime; ++end) {
      num += pairs[*end].matches.size();
    }
    std::vector<OpenMatches> open(end - begin);
    ParallelFor(num_threads, std::ssize(open), [&](int64_t i) {
      open[i] = FindOpenMatches(sets, nodes.MatchesOf(pairs[begin[i]]));
    });
    for (const OpenMatches& of_pair : open) {
      num_conflicting += of_pair.num_conflicting;
      for (const auto& [node1, node2] : of_pair.roots) {
        const int root1 = sets.Root(node1);
        const int root2 = sets.Root(node2);
        if (root1 == root2) continue;
        if (sets.ShareImage(root1, root2)) {
          ++num_conflicting;
        } else {
          sets.Join(root1, root2);
        }
      }
    }
  }
  return num_conflicting;
}

// The sets with enough members, in the order of their first ones.
std::vector<Track> TracksOf(const NodeSets& sets, const Nodes& nodes, int min_length,
                            int num_threads) {
  std::vector<int> roots;  // the smallest members
  for (int node = 0; node < nodes.Num(); ++node) {
    if (sets.IsRoot(node)) roots.push_back(node);
  }
  std::vector<Track> tracks(roots.size());
  ParallelFor(
      num_threads, std::ssize(roots),
      [&](int64_t i) {
        if (sets.SizeOf(roots[i]) < min_length) return;
        tracks[i].reserve(sets.SizeOf(roots[i]));
        sets.AnyMember(roots[i], [&](image_t, int node) {
          tracks[i].push_back(nodes.Element(node));
          return false;
        });
      },
      /*grain=*/1024);
  std::erase_if(tracks, [](const Track& track) { return track.empty(); });
  return tracks;
}

}  // namespace

void TrackOptions::VisitFields(OptionVisitor& v) {
  v.Int("min_length", min_length, {2, 1000}, "shortest track that is kept, in images");
  v.Int("max_per_image", max_per_image, {0, 1e9},
        "long tracks are picked until every image has so many; 0: all tracks");
}

TrackReport BuildTracks(std::span<const PairMatches> pairs, const TrackOptions& options,
                        const RunContext& run) {
  ValidateOptions(options, "tracks");
  const Nodes nodes(pairs, run.num_threads);
  NodeSets sets(nodes);
  TrackReport report;
  for (const PairMatches& pair : pairs) report.num_matches += std::ssize(pair.matches);
  report.num_conflicting = JoinMatches(pairs, OrderBySupport(pairs), nodes, run.num_threads, sets);
  report.tracks = TracksOf(sets, nodes, options.min_length, run.num_threads);
  if (options.max_per_image > 0) {
    report.tracks = SelectTracks(report.tracks, options.max_per_image);
  }
  report.num_tracks = static_cast<int64_t>(report.tracks.size());
  for (const Track& track : report.tracks) {
    report.num_observations += static_cast<int64_t>(track.size());
  }
  return report;
}

std::vector<Track> SelectTracks(std::span<const Track> tracks, int min_per_image) {
  std::unordered_map<image_t, int> per_image;
  std::vector<char> is_selected(tracks.size(), 0);
  const auto key = [&](int i) { return -std::ssize(tracks[i]); };
  for (const int i : SortedOrder(tracks.size(), key)) {
    const Track& track = tracks[i];
    is_selected[i] = std::any_of(track.begin(), track.end(), [&](const TrackElement& element) {
      return per_image[element.image_id] < min_per_image;
    });
    if (!is_selected[i]) continue;
    for (const TrackElement& element : track) ++per_image[element.image_id];
  }
  std::vector<Track> selected;
  for (size_t i = 0; i < tracks.size(); ++i) {
    if (is_selected[i]) selected.push_back(tracks[i]);
  }
  return selected;
}

std::vector<point2D_t> FirstKeypointsAtPosition(std::span<const Keypoint> keypoints) {
  const std::vector<int> order = SortedOrder(
      keypoints.size(), [&](int i) { return std::make_pair(keypoints[i].x, keypoints[i].y); });
  std::vector<point2D_t> first(keypoints.size());
  for (size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && keypoints[order[i]].x == keypoints[order[i - 1]].x &&
                      keypoints[order[i]].y == keypoints[order[i - 1]].y;
    first[order[i]] = same ? first[order[i - 1]] : order[i];
  }
  return first;
}

}  // namespace cairn
