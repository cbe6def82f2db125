#include "cairn/tracks/tracks.h"

#include <algorithm>
#include <limits>
#include <tuple>
#include <unordered_map>

#include "cairn/base/check.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

constexpr size_t kLookahead = 16;  // matches; some ten lookups fit into one wait for memory

// Keypoints that are matched, as consecutive nodes, ordered by (image, keypoint), so that node
// order is element order.
class Nodes {
 public:
  explicit Nodes(std::span<const PairMatches> pairs) {
    for (const PairMatches& pair : pairs) {
      CAIRN_CHECK_NE(pair.image_id1, pair.image_id2);
      if (pair.matches.empty()) continue;
      std::vector<int>& marks1 = node_of_[pair.image_id1];
      std::vector<int>& marks2 = node_of_[pair.image_id2];
      for (const FeatureMatch& match : pair.matches) {
        Mark(marks1, match.point1);
        Mark(marks2, match.point2);
      }
    }
    for (auto& [image_id, marks] : node_of_) {
      for (size_t point = 0; point < marks.size(); ++point) {
        if (marks[point] < 0) continue;
        CAIRN_CHECK_LT(elements_.size(), static_cast<size_t>(std::numeric_limits<int>::max()));
        marks[point] = static_cast<int>(elements_.size());
        elements_.push_back({image_id, static_cast<point2D_t>(point)});
      }
    }
  }

  int Num() const { return static_cast<int>(elements_.size()); }
  const TrackElement& Element(int node) const { return elements_[node]; }
  image_t ImageOf(int node) const { return elements_[node].image_id; }
  // The pair's matches as pairs of nodes, sorted.
  void MatchesOf(const PairMatches& pair, std::vector<std::pair<int, int>>& matches) const {
    matches.clear();
    if (pair.matches.empty()) return;
    const std::vector<int>& nodes1 = node_of_.at(pair.image_id1);
    const std::vector<int>& nodes2 = node_of_.at(pair.image_id2);
    for (const FeatureMatch& match : pair.matches) {
      matches.emplace_back(std::minmax(nodes1[match.point1], nodes2[match.point2]));
    }
    if (!std::is_sorted(matches.begin(), matches.end())) std::sort(matches.begin(), matches.end());
  }

 private:
  static void Mark(std::vector<int>& marks, point2D_t point) {
    if (marks.size() <= point) marks.resize(point + 1, -1);
    marks[point] = 0;
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

// Disjoint sets of nodes, each a list in ascending order that begins at its root. What a walk along
// a list reads of a node lies together: members are far apart, and each costs a wait for memory.
class NodeSets {
 public:
  explicit NodeSets(const Nodes& nodes) : members_(nodes.Num()) {
    for (int node = 0; node < nodes.Num(); ++node) {
      members_[node] = {.parent = node, .next = -1, .image_id = nodes.ImageOf(node)};
    }
  }

  int Root(int node) {
    while (members_[node].parent != node) {
      members_[node].parent = members_[members_[node].parent].parent;
      node = members_[node].parent;
    }
    return node;
  }
  // Has memory load what Root(node) will read.
  void Prefetch(int node) const { __builtin_prefetch(&members_[members_[node].parent]); }
  bool IsRoot(int node) const { return members_[node].parent == node; }
  int Next(int node) const { return members_[node].next; }  // -1: the last one
  // Ascending nodes have ascending images.
  bool ShareImage(int root1, int root2) const {
    for (int a = root1, b = root2; a >= 0 && b >= 0;) {
      const image_t image1 = members_[a].image_id;
      const image_t image2 = members_[b].image_id;
      if (image1 == image2) return true;
      int& behind = image1 < image2 ? a : b;
      behind = members_[behind].next;
    }
    return false;
  }
  void Join(int root1, int root2) {
    if (root1 > root2) std::swap(root1, root2);
    members_[root2].parent = root1;
    int last = root1, a = members_[root1].next, b = root2;
    while (a >= 0 && b >= 0) {
      int& smaller = a < b ? a : b;
      last = members_[last].next = smaller;
      smaller = members_[smaller].next;
    }
    members_[last].next = a >= 0 ? a : b;
  }

 private:
  struct Member {
    int parent;
    int next;
    image_t image_id;
  };
  std::vector<Member> members_;
};

}  // namespace

void TrackOptions::VisitFields(OptionVisitor& v) {
  v.Int("min_length", min_length, {2, 1000}, "shortest track that is kept, in images");
  v.Int("max_per_image", max_per_image, {0, 1e9},
        "long tracks are picked until every image has so many; 0: all tracks");
}

TrackReport BuildTracks(std::span<const PairMatches> pairs, const TrackOptions& options) {
  ValidateOptions(options, "tracks");
  const Nodes nodes(pairs);
  NodeSets sets(nodes);
  TrackReport report;
  std::vector<std::pair<int, int>> matches;
  for (const int i : OrderBySupport(pairs)) {
    nodes.MatchesOf(pairs[i], matches);
    report.num_matches += static_cast<int64_t>(matches.size());
    for (size_t m = 0; m < matches.size(); ++m) {
      if (m + kLookahead < matches.size()) {
        sets.Prefetch(matches[m + kLookahead].first);
        sets.Prefetch(matches[m + kLookahead].second);
      }
      const auto [node1, node2] = matches[m];
      const int root1 = sets.Root(node1);
      const int root2 = sets.Root(node2);
      if (root1 == root2) continue;
      if (sets.ShareImage(root1, root2)) {
        ++report.num_conflicting;
      } else {
        sets.Join(root1, root2);
      }
    }
  }
  // Roots are the smallest members: their order is that of the tracks.
  for (int root = 0; root < nodes.Num(); ++root) {
    if (!sets.IsRoot(root)) continue;
    Track track;
    for (int node = root; node >= 0; node = sets.Next(node)) track.push_back(nodes.Element(node));
    track.shrink_to_fit();
    if (std::ssize(track) >= options.min_length) report.tracks.push_back(std::move(track));
  }
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
