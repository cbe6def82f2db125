#include "two_view/prepare/local_consensus.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "two_view/prepare/consensus_kernel.h"

namespace cairn::internal {
namespace {

constexpr int kNumColumns = ConsensusColumns::kNum;
// Neighbours lie within this share of the image diagonal; fewer pixels where matches are dense.
constexpr double kRadius = 0.1;
constexpr double kWantedNeighbours = 60.0;

// A circle of this radius holds the wanted number of matches, if they spread over the image.
float Radius(const Camera& camera, int num_matches) {
  const double area = static_cast<double>(camera.width) * camera.height;
  const double dense = std::sqrt(kWantedNeighbours * area / (M_PI * std::max(1, num_matches)));
  return static_cast<float>(std::min(kRadius * camera.DiagonalPx(), dense));
}

// Bits that are in the order of the numbers.
uint32_t OrderedBits(float value) {
  constexpr uint32_t kSign = 0x80000000;
  const auto bits = std::bit_cast<uint32_t>(value);
  return (bits & kSign) != 0 ? ~bits : bits | kSign;
}

// x1 y1 x2 y2, A (4), A^-1 (4).
std::array<float, kNumColumns> RowOf(const PairInput& input, const FeatureMatch& match) {
  const Keypoint& keypoint1 = input.keypoints1[match.point1];
  const Keypoint& keypoint2 = input.keypoints2[match.point2];
  const Eigen::Matrix2f M1 = keypoint1.Shape().cast<float>();
  const Eigen::Matrix2f M2 = keypoint2.Shape().cast<float>();
  const Eigen::Matrix2f A = M2 * M1.inverse(), B = M1 * M2.inverse();
  return {keypoint1.x, keypoint1.y, keypoint2.x, keypoint2.y, A(0, 0), A(0, 1),
          A(1, 0),     A(1, 1),     B(0, 0),     B(0, 1),     B(1, 0), B(1, 1)};
}

// The ranks of matches by their first points' x.
std::vector<int32_t> OrderByX1(const PairInput& input, std::span<const int32_t> indices) {
  std::vector<uint64_t> keys;
  keys.reserve(indices.size());
  for (size_t k = 0; k < indices.size(); ++k) {
    const float x1 = input.keypoints1[input.matches[indices[k]].point1].x;
    keys.push_back(uint64_t{OrderedBits(x1)} << 32 | static_cast<uint32_t>(k));
  }
  std::sort(keys.begin(), keys.end());
  std::vector<int32_t> order;
  order.reserve(keys.size());
  for (const uint64_t key : keys) order.push_back(static_cast<int32_t>(key & 0xffffffff));
  return order;
}

}  // namespace

LocalConsensus CountVotes(const PairInput& input, std::span<const int32_t> indices) {
  const int size = static_cast<int>(indices.size());
  const int stride = size + ConsensusColumns::kPadding;
  const std::vector<int32_t> order = OrderByX1(input, indices);
  // Beyond the last match: out of every neighbourhood.
  std::vector<float> columns(static_cast<size_t>(kNumColumns) * stride, 1e9f);
  for (int k = 0; k < size; ++k) {
    const auto row = RowOf(input, input.matches[indices[order[k]]]);
    for (int c = 0; c < kNumColumns; ++c) columns[static_cast<size_t>(c) * stride + k] = row[c];
  }
  std::vector<float> counts(stride, 0.0f);
  const float radius1_px = Radius(*input.camera1, size);
  const float radius2_px = Radius(*input.camera2, size);
  const double num_neighbours =
      CountConsensus({columns.data(), size, stride}, radius1_px, radius2_px, counts.data());
  LocalConsensus consensus;
  consensus.votes.resize(size);
  for (int k = 0; k < size; ++k) {
    consensus.votes[order[k]] = static_cast<int>(counts[k]);
    consensus.num_votes += 0.5 * counts[k];  // A vote counts for both of its matches.
  }
  // Two predictions a pair of neighbours, each right by chance with the share that the tolerance
  // has of the neighbourhood.
  const double squared_radius = 0.5 * (radius1_px * radius1_px + radius2_px * radius2_px);
  consensus.num_votes_by_chance = 2.0 * num_neighbours * ConsensusChance(squared_radius);
  return consensus;
}

}  // namespace cairn::internal
