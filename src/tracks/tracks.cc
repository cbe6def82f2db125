#include "cairn/tracks/tracks.h"

#include <algorithm>
#include <numeric>
#include <tuple>
#include <unordered_map>

#include "cairn/base/check.h"

namespace cairn {
namespace {

// Keypoints as consecutive nodes, ordered by (image, keypoint), so that node order is element
// order.
struct Nodes {
  std::vector<TrackElement> elements;
  std::vector<std::pair<int, int>> matches;  // node indices, best-supported pairs first
};

Nodes NumberKeypoints(std::span<const PairMatches> pairs) {
  // Pairs by falling support; the images break ties, so that the order given does not matter.
  std::vector<size_t> order(pairs.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    const auto key = [&](size_t i) {
      return std::make_tuple(-static_cast<int64_t>(pairs[i].matches.size()), pairs[i].image_id1,
                             pairs[i].image_id2);
    };
    return key(a) < key(b);
  });

  // node_of[image][keypoint], filled with marks first, then with node numbers.
  std::map<image_t, std::vector<int>> node_of;
  const auto mark = [&](image_t image_id, point2D_t point) {
    std::vector<int>& marks = node_of[image_id];
    if (marks.size() <= point) marks.resize(point + 1, -1);
    marks[point] = 0;
  };
  for (const PairMatches& pair : pairs) {
    CAIRN_CHECK_NE(pair.image_id1, pair.image_id2);
    for (const FeatureMatch& match : pair.matches) {
      mark(pair.image_id1, match.point1);
      mark(pair.image_id2, match.point2);
    }
  }
  Nodes nodes;
  for (auto& [image_id, marks] : node_of) {
    for (size_t point = 0; point < marks.size(); ++point) {
      if (marks[point] < 0) continue;
      marks[point] = static_cast<int>(nodes.elements.size());
      nodes.elements.push_back({image_id, static_cast<point2D_t>(point)});
    }
  }
  for (const size_t i : order) {
    const PairMatches& pair = pairs[i];
    if (pair.matches.empty()) continue;
    const std::vector<int>& nodes1 = node_of.at(pair.image_id1);
    const std::vector<int>& nodes2 = node_of.at(pair.image_id2);
    const size_t begin = nodes.matches.size();
    for (const FeatureMatch& match : pair.matches) {
      nodes.matches.emplace_back(std::minmax(nodes1[match.point1], nodes2[match.point2]));
    }
    std::sort(nodes.matches.begin() + static_cast<int64_t>(begin), nodes.matches.end());
  }
  return nodes;
}

// Disjoint sets of nodes that know their members, and so whether they share an image.
class NodeSets {
 public:
  NodeSets(const std::vector<TrackElement>& elements)
      : elements_(elements), parent_(elements.size()), members_(elements.size()) {
    std::iota(parent_.begin(), parent_.end(), 0);
    for (size_t i = 0; i < members_.size(); ++i) members_[i] = {static_cast<int>(i)};
  }

  int Root(int node) {
    while (parent_[node] != node) {
      parent_[node] = parent_[parent_[node]];
      node = parent_[node];
    }
    return node;
  }
  // Both lists of members are sorted by node, hence by image.
  bool ShareImage(int root1, int root2) const {
    const std::vector<int>& a = members_[root1];
    const std::vector<int>& b = members_[root2];
    for (size_t i = 0, j = 0; i < a.size() && j < b.size();) {
      const image_t image1 = elements_[a[i]].image_id;
      const image_t image2 = elements_[b[j]].image_id;
      if (image1 == image2) return true;
      image1 < image2 ? ++i : ++j;
    }
    return false;
  }
  void Join(int root1, int root2) {
    if (members_[root1].size() < members_[root2].size()) std::swap(root1, root2);
    std::vector<int>& kept = members_[root1];
    std::vector<int>& moved = members_[root2];
    const auto middle = static_cast<int64_t>(kept.size());
    kept.insert(kept.end(), moved.begin(), moved.end());
    std::inplace_merge(kept.begin(), kept.begin() + middle, kept.end());
    parent_[root2] = root1;
    moved = {};
  }
  const std::vector<int>& Members(int root) const { return members_[root]; }

 private:
  const std::vector<TrackElement>& elements_;
  std::vector<int> parent_;
  std::vector<std::vector<int>> members_;  // of roots, ascending
};

}  // namespace

void TrackOptions::VisitFields(OptionVisitor& v) {
  v.Int("min_length", min_length, {2, 1000}, "shortest track that is kept, in images");
  v.Int("max_per_image", max_per_image, {0, 1e9},
        "long tracks are picked until every image has so many; 0: all tracks");
}

TrackReport BuildTracks(std::span<const PairMatches> pairs, const TrackOptions& options) {
  ValidateOptions(options, "tracks");
  const Nodes nodes = NumberKeypoints(pairs);
  NodeSets sets(nodes.elements);
  TrackReport report;
  report.num_matches = static_cast<int64_t>(nodes.matches.size());
  for (const auto& [node1, node2] : nodes.matches) {
    const int root1 = sets.Root(node1);
    const int root2 = sets.Root(node2);
    if (root1 == root2) continue;
    if (sets.ShareImage(root1, root2)) {
      ++report.num_conflicting;
    } else {
      sets.Join(root1, root2);
    }
  }
  // Roots in the order of their smallest member, which is the order of the tracks.
  for (int node = 0; node < static_cast<int>(nodes.elements.size()); ++node) {
    const std::vector<int>& members = sets.Members(sets.Root(node));
    if (members.front() != node) continue;
    Track track;
    track.reserve(members.size());
    for (const int member : members) track.push_back(nodes.elements[member]);
    if (static_cast<int>(track.size()) < options.min_length) {
      ++report.num_too_short;
    } else {
      report.tracks.push_back(std::move(track));
    }
  }
  report.num_tracks_before_selection = static_cast<int64_t>(report.tracks.size());
  if (options.max_per_image > 0) {
    std::vector<Track> selected;
    for (const size_t i : SelectTracks(report.tracks, options.max_per_image, 0)) {
      selected.push_back(std::move(report.tracks[i]));
    }
    report.tracks = std::move(selected);
  }
  report.num_tracks = static_cast<int64_t>(report.tracks.size());
  for (const Track& track : report.tracks) {
    report.num_observations += static_cast<int64_t>(track.size());
  }
  return report;
}

std::vector<size_t> SelectTracks(std::span<const Track> tracks, int min_per_image,
                                 int min_per_pair) {
  std::vector<size_t> order(tracks.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return tracks[a].size() > tracks[b].size(); });
  std::unordered_map<image_t, int> per_image;
  std::unordered_map<image_pair_t, int> per_pair;
  std::vector<size_t> selected;
  for (const size_t i : order) {
    const Track& track = tracks[i];
    bool needed = false;
    for (size_t a = 0; a < track.size() && !needed; ++a) {
      needed = per_image[track[a].image_id] < min_per_image;
      for (size_t b = 0; b < a && !needed && min_per_pair > 0; ++b) {
        needed = per_pair[ImagePairToPairId(track[a].image_id, track[b].image_id)] < min_per_pair;
      }
    }
    if (!needed) continue;
    selected.push_back(i);
    for (size_t a = 0; a < track.size(); ++a) {
      ++per_image[track[a].image_id];
      for (size_t b = 0; b < a && min_per_pair > 0; ++b) {
        ++per_pair[ImagePairToPairId(track[a].image_id, track[b].image_id)];
      }
    }
  }
  std::sort(selected.begin(), selected.end());
  return selected;
}

std::vector<point2D_t> FirstKeypointsAtPosition(std::span<const Keypoint> keypoints) {
  std::vector<point2D_t> order(keypoints.size());
  std::iota(order.begin(), order.end(), point2D_t{0});
  std::sort(order.begin(), order.end(), [&](point2D_t a, point2D_t b) {
    return std::make_tuple(keypoints[a].x, keypoints[a].y, a) <
           std::make_tuple(keypoints[b].x, keypoints[b].y, b);
  });
  std::vector<point2D_t> first(keypoints.size());
  for (size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && keypoints[order[i]].x == keypoints[order[i - 1]].x &&
                      keypoints[order[i]].y == keypoints[order[i - 1]].y;
    first[order[i]] = same ? first[order[i - 1]] : order[i];
  }
  return first;
}

}  // namespace cairn
