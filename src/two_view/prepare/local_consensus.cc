#include "two_view/prepare/local_consensus.h"

#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <cmath>

#include "two_view/prepare/consensus_kernel.h"

namespace cairn::internal {
namespace {

constexpr int kNumColumns = 12;
// Room behind the last match for a whole vector that starts at any match.
constexpr int kPadding = 16;
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

}  // namespace

void LocalConsensus::Count(const PairInput& input, std::span<const int32_t> indices) {
  size_ = static_cast<int>(indices.size());
  const int stride = size_ + kPadding;
  columns_.resize(static_cast<size_t>(kNumColumns) * stride);
  for (int k = 0; k < size_; ++k) {
    const FeatureMatch& match = input.matches[indices[k]];
    const Keypoint& keypoint1 = input.keypoints1[match.point1];
    const Keypoint& keypoint2 = input.keypoints2[match.point2];
    const Eigen::Matrix2f M1 = keypoint1.Shape().cast<float>();
    const Eigen::Matrix2f M2 = keypoint2.Shape().cast<float>();
    const Eigen::Matrix2f A = M2 * M1.inverse(), B = M1 * M2.inverse();
    const float row[kNumColumns] = {keypoint1.x, keypoint1.y, keypoint2.x, keypoint2.y,
                                    A(0, 0),     A(0, 1),     A(1, 0),     A(1, 1),
                                    B(0, 0),     B(0, 1),     B(1, 0),     B(1, 1)};
    for (int c = 0; c < kNumColumns; ++c) columns_[static_cast<size_t>(c) * stride + k] = row[c];
  }
  Sort();
  counts_.assign(size_ + kPadding, 0.0f);
  const float radius1_px = Radius(*input.camera1, size_);
  const float radius2_px = Radius(*input.camera2, size_);
  const double num_neighbours =
      CountConsensus(sorted_.data(), size_, stride, radius1_px, radius2_px, counts_.data());
  votes_.resize(size_);
  num_votes_ = 0.0;
  num_supported_ = 0;
  for (int k = 0; k < size_; ++k) {
    votes_[order_[k]] = static_cast<uint8_t>(std::min(counts_[k], static_cast<float>(kMaxVotes)));
    num_votes_ += 0.5 * counts_[k];  // A vote counts for both of its matches.
    num_supported_ += counts_[k] > 0.0f;
  }
  // Two predictions a pair of neighbours, each right by chance with the share that the tolerance
  // has of the neighbourhood.
  const double squared_radius = 0.5 * (radius1_px * radius1_px + radius2_px * radius2_px);
  num_votes_by_chance_ = 2.0 * num_neighbours * ConsensusChance(squared_radius);
}

void LocalConsensus::Sort() {
  const int stride = size_ + kPadding;
  keys_.clear();
  for (int k = 0; k < size_; ++k) {
    keys_.push_back(uint64_t{OrderedBits(columns_[k])} << 32 | static_cast<uint32_t>(k));
  }
  std::sort(keys_.begin(), keys_.end());
  order_.clear();
  for (const uint64_t key : keys_) order_.push_back(static_cast<int32_t>(key & 0xffffffff));
  sorted_.resize(columns_.size());
  for (int c = 0; c < kNumColumns; ++c) {
    const float* from = columns_.data() + static_cast<size_t>(c) * stride;
    float* to = sorted_.data() + static_cast<size_t>(c) * stride;
    for (int k = 0; k < size_; ++k) to[k] = from[order_[k]];
    // Beyond the last match: out of every neighbourhood.
    std::fill(to + size_, to + stride, 1e9f);
  }
}

}  // namespace cairn::internal
