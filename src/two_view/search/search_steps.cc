#include "two_view/search/search_steps.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "cairn/geometry/epipolar.h"
#include "cairn/math/so3.h"
#include "cairn/solvers/five_point.h"
#include "cairn/solvers/two_affine.h"
#include "two_view/prepare/lifting.h"

namespace cairn::internal {
namespace {

// Samples are drawn in turns from the matches that have votes, and from all; or rather than from
// all from the best half, quarter and eighth of them, where that is known (the idea of PROSAC: Chum
// and Matas, CVPR 2005).
void DrawSample(const PreparedPair& pair, int64_t turn, int sample_size, Rng* rng,
                uint32_t* sample) {
  const auto size = static_cast<uint32_t>(sample_size);
  if (turn % 2 == 0 && pair.NumSupported() >= 2 * sample_size) {
    rng->Sample(static_cast<uint32_t>(pair.NumSupported()), size, sample);
    return;
  }
  constexpr int kNumParts = 3;
  const auto num_best = static_cast<uint32_t>(pair.best_first.size() >> (1 + turn / 2 % kNumParts));
  if (num_best < 4 * size) {
    rng->Sample(static_cast<uint32_t>(pair.size()), size, sample);
    return;
  }
  rng->Sample(num_best, size, sample);
  for (uint32_t k = 0; k < size; ++k) sample[k] = pair.best_first[sample[k]];
}

}  // namespace

int OneAcDepthStep::Run(const PairInput& input, const PreparedPair& pair, int max_num_refined,
                        PoseSearch* search) {
  if (input.depth1.empty() || input.depth2.empty()) return 0;
  batch_.Reset(std::min(pair.size(), kMaxHypotheses));
  int count = 0;
  for (int i = 0; i < pair.size() && count < batch_.size(); ++i) {
    const FeatureMatch& match = input.matches[pair.match_index[i]];
    const DepthSample& depth1 = input.depth1[match.point1];
    const DepthSample& depth2 = input.depth2[match.point2];
    if (!depth1.is_valid || !depth2.is_valid) continue;
    if (pair.points.IsBehind1(i) || pair.points.IsBehind2(i)) continue;  // they have no z-depth
    const Keypoint& keypoint1 = input.keypoints1[match.point1];
    const Keypoint& keypoint2 = input.keypoints2[match.point2];
    batch_.Set(count++,
               LiftNormalized(NormalizeFrame(*input.camera1, keypoint1, pair.points.Ray1(i)),
                              keypoint1, depth1),
               LiftNormalized(NormalizeFrame(*input.camera2, keypoint2, pair.points.Ray2(i)),
                              keypoint2, depth2));
  }
  for (int i = count; i < batch_.size(); ++i) batch_.Set(i, {}, {});
  batch_.Solve();
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
  for (int i = 0; i < count; ++i) {
    if (batch_.Get(i, &R, &t)) search->Add(CrossMatrix(t) * R);
  }
  search->RefineBest(max_num_refined);
  return count;
}

void RunTwoAcStep(const PairInput& input, const PreparedPair& pair, int max_num_samples,
                  PoseSearch* search) {
  if (pair.size() < TwoAffineFivePoint::kSampleSize) return;
  constexpr int kBatch = 10, kNumRefined = 3;
  Rng rng(input.seed, "two_ac", input.pair_id);
  Eigen::Matrix3d models[TwoAffineFivePoint::kMaxSolutions];
  for (int turn = 0; turn < max_num_samples && !search->HasConverged(); ++turn) {
    uint32_t sample[2];
    DrawSample(pair, turn, 2, &rng, sample);
    AffineCorrespondence correspondences[2];
    for (int k = 0; k < 2; ++k) {
      const int i = static_cast<int>(sample[k]);
      const FeatureMatch& match = input.matches[pair.match_index[i]];
      correspondences[k] = {
          NormalizeFrame(*input.camera1, input.keypoints1[match.point1], pair.points.Ray1(i)),
          NormalizeFrame(*input.camera2, input.keypoints2[match.point2], pair.points.Ray2(i))};
    }
    const int count = TwoAffineFivePoint::Solve(correspondences, models);
    for (int k = 0; k < count; ++k) search->Add(models[k]);
    if (turn % kBatch == kBatch - 1 || turn + 1 == max_num_samples) {
      search->RefineBest(kNumRefined);
    }
  }
}

void RunFivePointStep(const PairInput& input, const PreparedPair& pair, int max_num_samples,
                      PoseSearch* search) {
  constexpr int kSampleSize = FivePoint::kSampleSize;
  if (pair.size() < kSampleSize) return;
  constexpr int kBatch = 20, kNumRefined = 2;
  Rng rng(input.seed, "five_point", input.pair_id);
  Eigen::Matrix3d models[FivePoint::kMaxSolutions];
  for (int turn = 0; turn < max_num_samples && !search->HasConverged(); ++turn) {
    uint32_t sample[kSampleSize];
    DrawSample(pair, turn, kSampleSize, &rng, sample);
    PointCorrespondence points[kSampleSize];
    for (int k = 0; k < kSampleSize; ++k) {
      const int i = static_cast<int>(sample[k]);
      points[k] = {pair.points.Point1(i), pair.points.Point2(i)};
    }
    const int count = FivePoint::Solve(points, models);
    for (int k = 0; k < count; ++k) search->Add(models[k]);
    if (turn % kBatch == kBatch - 1 || turn + 1 == max_num_samples) {
      search->RefineBest(kNumRefined);
    }
  }
}

}  // namespace cairn::internal
