#include "two_view/search/triangle_step.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

#include "cairn/geometry/epipolar.h"
#include "cairn/math/so3.h"

namespace cairn::internal {
namespace {

// Matches that triangles are drawn from: the first of a pair.
constexpr int kMaxPoints = 256;
// The share of the triples that is scored.
constexpr int kDrawnPerScored = 4;

LiftedFrame FrameOf(const Eigen::Vector3f& a, const Eigen::Vector3f& b, const Eigen::Vector3f& c) {
  LiftedFrame frame;
  frame.point = ((a + b + c) / 3.0f).cast<double>();
  frame.derivative.col(0) = (b - a).cast<double>();
  frame.derivative.col(1) = (c - a).cast<double>();
  return frame;
}

}  // namespace

int TriangleDepthStep::Run(const PairInput& input, const PreparedPair& pair, int max_num_samples,
                           int max_num_refined, PoseSearch* search) {
  if (input.depth1.empty() || input.depth2.empty()) return 0;
  Lift(input, pair);
  constexpr size_t kMinPoints = 6;
  if (points_.size() < kMinPoints) return 0;
  DrawTriples(input, max_num_samples);
  batch_.Reset(static_cast<int>(triples_.size()));
  for (size_t k = 0; k < triples_.size(); ++k) {
    const auto& [i, j, l] = triples_[k].index;
    batch_.Set(static_cast<int>(k), FrameOf(points_[i][0], points_[j][0], points_[l][0]),
               FrameOf(points_[i][1], points_[j][1], points_[l][1]));
  }
  batch_.Solve();
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
  for (int k = 0; k < batch_.size(); ++k) {
    if (batch_.Get(k, &R, &t)) search->Add(CrossMatrix(t) * R);
  }
  search->RefineBest(max_num_refined);
  return max_num_samples;
}

void TriangleDepthStep::Lift(const PairInput& input, const PreparedPair& pair) {
  points_.clear();
  for (int i = 0; i < std::min(pair.size(), kMaxPoints); ++i) {
    const FeatureMatch& match = input.matches[pair.match_index[i]];
    const DepthSample& depth1 = input.depth1[match.point1];
    const DepthSample& depth2 = input.depth2[match.point2];
    if (!depth1.is_valid || !depth2.is_valid) continue;
    if (pair.points.IsBehind1(i) || pair.points.IsBehind2(i)) continue;  // they have no z-depth
    points_.push_back({(depth1.depth * pair.points.Point1(i).homogeneous()).cast<float>(),
                       (depth2.depth * pair.points.Point2(i).homogeneous()).cast<float>()});
  }
}

void TriangleDepthStep::DrawTriples(const PairInput& input, int count) {
  Rng rng(input.seed, "triangles", input.pair_id);
  triples_.clear();
  for (int k = 0; k < count; ++k) {
    std::array<uint32_t, 3> index;
    rng.Sample(static_cast<uint32_t>(points_.size()), 3, index.data());
    triples_.push_back(Measure(index));
  }
  const int num_scored = (count + kDrawnPerScored - 1) / kDrawnPerScored;
  std::nth_element(triples_.begin(), triples_.begin() + (num_scored - 1), triples_.end(),
                   [](const Triple& a, const Triple& b) {
                     return a.distortion < b.distortion ||
                            (a.distortion == b.distortion && a.index < b.index);
                   });
  triples_.resize(num_scored);
}

TriangleDepthStep::Triple TriangleDepthStep::Measure(const std::array<uint32_t, 3>& index) const {
  float smallest = std::numeric_limits<float>::infinity(), largest = 0.0f;
  for (int k = 0; k < 3; ++k) {
    const auto& a = points_[index[k]];
    const auto& b = points_[index[(k + 1) % 3]];
    const float ratio = (a[1] - b[1]).squaredNorm() / (a[0] - b[0]).squaredNorm();
    smallest = std::min(smallest, ratio);
    largest = std::max(largest, ratio);
  }
  const float distortion = largest / smallest;
  return {index, distortion >= 1.0f ? distortion : std::numeric_limits<float>::infinity()};
}

}  // namespace cairn::internal
