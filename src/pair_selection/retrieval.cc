#include <algorithm>
#include <cmath>
#include <functional>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "cairn/pair_selection/pair_selection.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

constexpr int64_t kQueryRows = 64;

// The `num` images with the largest values that are not left out, best first.
std::vector<image_t> Largest(const Eigen::Ref<const Eigen::RowVectorXf>& values,
                             const std::vector<image_t>& ids, const Queries::value_type& query,
                             int num) {
  const auto& [self, asks] = query;
  std::vector<int> columns;
  for (int i = 0; i < values.size(); ++i) {
    const bool is_left_out = ids[i] == self || std::ranges::binary_search(asks.left_out, ids[i]) ||
                             (asks.part && std::ranges::binary_search(*asks.part, ids[i]));
    if (!is_left_out) columns.push_back(i);
  }
  const size_t kept = std::min(columns.size(), static_cast<size_t>(num));
  std::partial_sort(
      columns.begin(), columns.begin() + static_cast<std::ptrdiff_t>(kept), columns.end(),
      [&values](int a, int b) { return values(a) != values(b) ? values(a) > values(b) : a < b; });
  std::vector<image_t> largest;
  for (size_t i = 0; i < kept; ++i) largest.push_back(ids[columns[i]]);
  return largest;
}

// Numbers of matches of pairs of images; ascending by pair.
using MatchCounts = std::vector<std::pair<image_pair_t, int>>;

// Each pair once, whichever of its images asks.
MatchCounts CountMatches(const DescribedImages& images, std::vector<image_pair_t> pairs,
                         int num_threads) {
  MatchCounts counts;
  for (const image_pair_t pair : Unique(std::move(pairs))) counts.emplace_back(pair, 0);
  ParallelFor(num_threads, std::ssize(counts), [&](int64_t i) {
    const auto [id1, id2] = PairIdToImagePair(counts[i].first);
    const auto features = [&](image_t id) -> const Descriptors& {
      return images.largest_features[IndexIn(images.ids, id)];
    };
    counts[i].second =
        static_cast<int>(MatchDescriptors(features(id1), features(id2), MatchingOptions()).size());
  });
  return counts;
}

}  // namespace

std::vector<std::vector<image_t>> MostSimilar(const DescribedImages& images, const Queries& queries,
                                              int num, int num_threads) {
  std::vector<const Queries::value_type*> each;
  for (const auto& query : queries) {
    if (std::ranges::binary_search(images.ids, query.first)) each.push_back(&query);
  }
  std::vector<std::vector<image_t>> similar(each.size());
  const int64_t num_blocks = (std::ssize(each) + kQueryRows - 1) / kQueryRows;
  ParallelFor(num_threads, num_blocks, [&](int64_t b) {
    const int64_t first = b * kQueryRows;
    const int64_t count = std::min<int64_t>(kQueryRows, std::ssize(each) - first);
    FloatRows rows(count, images.descriptions.cols());
    for (int64_t i = 0; i < count; ++i) {
      rows.row(i) = images.descriptions.row(IndexIn(images.ids, each[first + i]->first));
    }
    const FloatRows products = rows * images.descriptions.transpose();
    for (int64_t i = 0; i < count; ++i) {
      similar[first + i] = Largest(products.row(i), images.ids, *each[first + i], num);
    }
  });
  return similar;
}

Descriptors LargestFeatures(const std::vector<Keypoint>& keypoints, const Descriptors& descriptors,
                            int num) {
  CAIRN_CHECK_EQ(static_cast<Eigen::Index>(keypoints.size()), descriptors.rows());
  std::vector<std::pair<double, Eigen::Index>> ranked;  // larger areas first
  for (size_t i = 0; i < keypoints.size(); ++i) {
    const Keypoint& k = keypoints[i];
    const double area = std::abs(double{k.a11} * k.a22 - double{k.a12} * k.a21);
    ranked.emplace_back(-area, static_cast<Eigen::Index>(i));
  }
  std::sort(ranked.begin(), ranked.end());
  ranked.resize(std::min(ranked.size(), static_cast<size_t>(num)));
  Descriptors largest(static_cast<Eigen::Index>(ranked.size()), descriptors.cols());
  for (size_t i = 0; i < ranked.size(); ++i) {
    largest.row(static_cast<Eigen::Index>(i)) = descriptors.row(ranked[i].second);
  }
  return largest;
}

Candidates FindCandidates(const DescribedImages& images, const Queries& queries, int num_candidates,
                          int num_threads) {
  CAIRN_CHECK_EQ(static_cast<Eigen::Index>(images.ids.size()), images.descriptions.rows());
  CAIRN_CHECK_EQ(images.ids.size(), images.largest_features.size());
  Candidates candidates;
  std::vector<image_pair_t> pairs;
  const auto similar = MostSimilar(images, queries, num_candidates, num_threads);
  auto of_image = similar.begin();
  for (const auto& [id, query] : queries) {
    if (!std::ranges::binary_search(images.ids, id)) continue;
    for (const image_t other : *of_image++) {
      candidates[id].push_back({other, 0});
      pairs.push_back(ImagePairToPairId(id, other));
    }
  }
  const MatchCounts counts = CountMatches(images, std::move(pairs), num_threads);
  for (auto& [id, found] : candidates) {
    for (Candidate& candidate : found) {
      candidate.num_matches =
          std::ranges::lower_bound(counts, ImagePairToPairId(id, candidate.image_id), {},
                                   &MatchCounts::value_type::first)
              ->second;
    }
    std::ranges::stable_sort(found, std::greater(), &Candidate::num_matches);
  }
  return candidates;
}

std::vector<image_pair_t> RetrievalPairs(const Candidates& candidates, int neighbors) {
  std::vector<image_pair_t> pairs;
  for (const auto& [image, of_image] : candidates) {
    const size_t num = std::min(of_image.size(), static_cast<size_t>(neighbors));
    for (size_t k = 0; k < num; ++k) {
      pairs.push_back(ImagePairToPairId(image, of_image[k].image_id));
    }
  }
  return Unique(std::move(pairs));
}

}  // namespace cairn
