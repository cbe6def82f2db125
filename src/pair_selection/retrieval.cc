#include <algorithm>
#include <cmath>
#include <numeric>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "cairn/pair_selection/pair_selection.h"
#include "pair_selection/unique_pairs.h"

namespace cairn {
namespace {

constexpr Eigen::Index kQueryRows = 64;

// The `num` columns with the largest values but `self`, best first.
std::vector<int> LargestColumns(const Eigen::Ref<const Eigen::RowVectorXf>& values, int self,
                                int num) {
  std::vector<int> columns(static_cast<size_t>(values.size()));
  std::iota(columns.begin(), columns.end(), 0);
  columns.erase(columns.begin() + self);
  const size_t kept = std::min(columns.size(), static_cast<size_t>(num));
  std::partial_sort(
      columns.begin(), columns.begin() + static_cast<std::ptrdiff_t>(kept), columns.end(),
      [&values](int a, int b) { return values(a) != values(b) ? values(a) > values(b) : a < b; });
  columns.resize(kept);
  return columns;
}

}  // namespace

std::vector<std::vector<int>> MostSimilarRows(const FloatRows& rows, int num, int num_threads) {
  std::vector<std::vector<int>> similar(static_cast<size_t>(rows.rows()));
  const Eigen::Index num_blocks = (rows.rows() + kQueryRows - 1) / kQueryRows;
  ParallelFor(num_threads, num_blocks, [&](int64_t b) {
    const Eigen::Index first = b * kQueryRows;
    const Eigen::Index count = std::min(kQueryRows, rows.rows() - first);
    const FloatRows products = rows.middleRows(first, count) * rows.transpose();
    for (Eigen::Index i = 0; i < count; ++i) {
      similar[first + i] = LargestColumns(products.row(i), static_cast<int>(first + i), num);
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

std::map<image_t, std::vector<Candidate>> FindCandidates(
    const std::vector<image_t>& images, const FloatRows& descriptions,
    const std::vector<Descriptors>& largest_features, int num_candidates, int num_threads) {
  CAIRN_CHECK_EQ(static_cast<Eigen::Index>(images.size()), descriptions.rows());
  CAIRN_CHECK_EQ(images.size(), largest_features.size());
  const auto similar = MostSimilarRows(descriptions, num_candidates, num_threads);
  std::vector<std::vector<Candidate>> of_row(images.size());
  ParallelFor(num_threads, std::ssize(images), [&](int64_t i) {
    for (const int j : similar[i]) {
      // (Of the smaller row with the larger, so that both have the same count.)
      const size_t first = std::min<size_t>(i, j), second = std::max<size_t>(i, j);
      const FeatureMatches matches =
          MatchDescriptors(largest_features[first], largest_features[second], MatchingOptions());
      of_row[i].push_back({images[j], static_cast<int>(matches.size())});
    }
    std::stable_sort(
        of_row[i].begin(), of_row[i].end(),
        [](const Candidate& a, const Candidate& b) { return a.num_matches > b.num_matches; });
  });
  std::map<image_t, std::vector<Candidate>> candidates;
  for (size_t i = 0; i < images.size(); ++i) candidates[images[i]] = std::move(of_row[i]);
  return candidates;
}

std::vector<image_pair_t> RetrievalPairs(
    const std::map<image_t, std::vector<Candidate>>& candidates, int neighbors) {
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
