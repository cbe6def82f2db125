#include <algorithm>
#include <functional>
#include <utility>

#include "cairn/base/parallel.h"
#include "cairn/pair_selection/pair_selection.h"
#include "graph/graph.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

// A keypoint of an image, and where an inlier match leads from it.
struct Link {
  point2D_t point = 0;
  image_t other = 0;
  point2D_t other_point = 0;
};

using LinksOfImages = std::map<image_t, std::vector<Link>>;  // by point

LinksOfImages FindLinks(const PairEvidence& evidence) {
  LinksOfImages links;
  for (const auto& [pair, inliers] : evidence.verified) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    for (const FeatureMatch& match : inliers) {
      links[id1].push_back({match.point1, id2, match.point2});
      links[id2].push_back({match.point2, id1, match.point1});
    }
  }
  for (auto& [image, of_image] : links) std::ranges::stable_sort(of_image, {}, &Link::point);
  return links;
}

// Images with larger ids that two links lead to, and how many of this image's keypoints they lead
// from.
std::map<image_t, int> CountSharedPoints(image_t image, const LinksOfImages& links) {
  std::vector<std::pair<image_t, point2D_t>> reached;
  for (const Link& first : links.at(image)) {
    const std::vector<Link>& next = links.at(first.other);
    auto second = std::ranges::lower_bound(next, first.other_point, {}, &Link::point);
    for (; second != next.end() && second->point == first.other_point; ++second) {
      if (second->other > image) reached.emplace_back(second->other, first.point);
    }
  }
  reached = Unique(std::move(reached));
  std::map<image_t, int> counts;
  for (const auto& [other, point] : reached) ++counts[other];
  return counts;
}

using NeighborsOfImages = std::map<image_t, std::set<image_t>>;

NeighborsOfImages FindNeighbors(const PairEvidence& evidence) {
  NeighborsOfImages neighbors;
  for (const image_t image : evidence.images) neighbors[image];
  for (const auto& [pair, inliers] : evidence.verified) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    neighbors[id1].insert(id2);
    neighbors[id2].insert(id1);
  }
  return neighbors;
}

// Of every image, those that it was matched with; ascending.
Queries FindMatched(const PairEvidence& evidence) {
  Queries matched;
  for (const image_t image : evidence.images) matched[image];
  for (const image_pair_t pair : evidence.matched) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    matched[id1].left_out.push_back(id2);
    matched[id2].left_out.push_back(id1);
  }
  for (auto& [image, query] : matched) std::ranges::sort(query.left_out);
  return matched;
}

// Component of every image; 0 is the largest.
std::map<image_t, int> FindComponents(const PairEvidence& evidence) {
  const std::vector<image_t> images(evidence.images.begin(), evidence.images.end());
  std::vector<GraphEdge> edges;
  for (const auto& [pair, inliers] : evidence.verified) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    edges.push_back({IndexIn(images, id1), IndexIn(images, id2)});
  }
  const GraphComponents components = ConnectedComponents(static_cast<int>(images.size()), edges);
  std::map<image_t, int> component_of;
  for (size_t i = 0; i < images.size(); ++i) {
    component_of[images[i]] = components.component_of_node[i];
  }
  return component_of;
}

// The count of matches of largest features that separates verified candidates from matched, but not
// verified, ones with the fewest errors; of equal ones the largest.
int SeparatingCount(const PairEvidence& evidence, const Candidates& candidates) {
  std::map<int, int, std::greater<>> gain;  // count -> verified less others with that count
  for (const auto& [image, of_image] : candidates) {
    for (const Candidate& candidate : of_image) {
      const image_pair_t pair = ImagePairToPairId(image, candidate.image_id);
      if (!evidence.matched.contains(pair)) continue;
      gain[candidate.num_matches] += evidence.verified.contains(pair) ? 1 : -1;
    }
  }
  int best = gain.empty() ? 1 : gain.begin()->first + 1;
  int sum = 0, largest = 0;
  for (const auto& [count, change] : gain) {
    sum += change;
    if (sum > largest) largest = sum, best = count;
  }
  return best;
}

}  // namespace

std::vector<image_pair_t> PairsTwoEdgesApart(const PairEvidence& evidence, int min_shared_points,
                                             int max_neighbors, int num_threads) {
  const LinksOfImages links = FindLinks(evidence);
  std::vector<image_t> images;
  for (const auto& [image, of_image] : links) images.push_back(image);
  std::vector<std::map<image_t, int>> counts(images.size());
  ParallelFor(num_threads, std::ssize(images),
              [&](int64_t i) { counts[i] = CountSharedPoints(images[i], links); });
  // Of each image: minus the number of shared points, and with which other.
  std::map<image_t, std::vector<std::pair<int, image_t>>> found;
  for (size_t i = 0; i < images.size(); ++i) {
    for (const auto& [other, count] : counts[i]) {
      if (count < min_shared_points) continue;
      if (evidence.matched.contains(ImagePairToPairId(images[i], other))) continue;
      found[images[i]].emplace_back(-count, other);
      found[other].emplace_back(-count, images[i]);
    }
  }
  const NeighborsOfImages neighbors = FindNeighbors(evidence);
  std::vector<image_pair_t> pairs;
  for (auto& [image, of_image] : found) {
    std::sort(of_image.begin(), of_image.end());
    const int64_t num_missing = max_neighbors - std::ssize(neighbors.at(image));
    for (int64_t k = 0; k < std::min(num_missing, std::ssize(of_image)); ++k) {
      pairs.push_back(ImagePairToPairId(image, of_image[k].second));
    }
  }
  return Unique(std::move(pairs));
}

Queries AskForLoops(const PairEvidence& evidence, int num_threads) {
  const NeighborsOfImages neighbors = FindNeighbors(evidence);
  Queries queries = FindMatched(evidence);
  std::vector<Queries::value_type*> each;
  for (auto& query : queries) each.push_back(&query);
  ParallelFor(num_threads, std::ssize(each), [&](int64_t i) {
    const auto own = neighbors.find(each[i]->first);
    if (own == neighbors.end()) return;
    std::vector<image_t>& left_out = each[i]->second.left_out;
    left_out.insert(left_out.end(), own->second.begin(), own->second.end());
    for (const image_t neighbor : own->second) {
      const std::set<image_t>& next = neighbors.at(neighbor);
      left_out.insert(left_out.end(), next.begin(), next.end());
    }
    left_out = Unique(std::move(left_out));
  });
  return queries;
}

std::vector<image_pair_t> PairsClosingLoops(const PairEvidence& evidence, const Candidates& first,
                                            const Candidates& found) {
  const int min_matches = SeparatingCount(evidence, first);
  std::vector<image_pair_t> pairs;
  for (const auto& [image, of_image] : found) {
    if (of_image.empty() || of_image.front().num_matches < min_matches) continue;
    pairs.push_back(ImagePairToPairId(image, of_image.front().image_id));
  }
  return Unique(std::move(pairs));
}

Queries AskForWeakImages(const PairEvidence& evidence) {
  const NeighborsOfImages neighbors = FindNeighbors(evidence);
  const std::map<image_t, int> component_of = FindComponents(evidence);
  std::map<int, std::shared_ptr<std::vector<image_t>>> parts;
  for (const auto& [image, component] : component_of) {
    auto& part = parts[component];
    if (!part) part = std::make_shared<std::vector<image_t>>();
    part->push_back(image);
  }
  Queries queries;
  for (auto& [image, query] : FindMatched(evidence)) {
    const auto component = component_of.find(image);
    if (component == component_of.end()) continue;
    const bool is_apart = component->second != 0;
    if (!is_apart && std::ssize(neighbors.at(image)) >= kFewPairs) continue;
    if (is_apart) query.part = parts.at(component->second);
    queries[image] = std::move(query);
  }
  return queries;
}

}  // namespace cairn
