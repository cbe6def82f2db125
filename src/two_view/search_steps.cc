#include "two_view/search_steps.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>

#include "cairn/geometry/epipolar.h"
#include "cairn/math/angles.h"
#include "cairn/math/so3.h"
#include "cairn/solvers/five_point.h"
#include "cairn/solvers/two_affine.h"

namespace cairn::internal {
namespace {

// Samples are drawn in turns from the matches that have votes, and from all.
void DrawSample(const PreparedPair& pair, int64_t turn, int sample_size, Rng* rng,
                uint32_t* sample) {
  const bool supported = turn % 2 == 0 && pair.num_supported >= 2 * sample_size;
  const int n = supported ? pair.num_supported : pair.size();
  rng->Sample(static_cast<uint32_t>(n), static_cast<uint32_t>(sample_size), sample);
}

// In normalized coordinates, at the undistorted position x of the keypoint.
NormalizedFrame NormalizeFrame(const Camera& camera, const Keypoint& keypoint,
                               const Eigen::Vector2d& x) {
  Eigen::Matrix2d dpixel_dx;
  camera.ImgFromCam(x, &dpixel_dx);
  return {x, dpixel_dx.inverse() * keypoint.Shape()};
}

// LiftFrame for a position that is known in normalized coordinates already.
LiftedFrame Lift(const Camera& camera, const Keypoint& keypoint, const Eigen::Vector2d& x,
                 const DepthSample& sample) {
  const Eigen::Matrix2d shape = NormalizeFrame(camera, keypoint, x).shape;
  const double gradient1 = sample.ddepth_dx * keypoint.a11 + sample.ddepth_dy * keypoint.a21;
  const double gradient2 = sample.ddepth_dx * keypoint.a12 + sample.ddepth_dy * keypoint.a22;
  LiftedFrame lifted;
  lifted.point = sample.depth * x.homogeneous();
  lifted.derivative.col(0) = gradient1 * x.homogeneous();
  lifted.derivative.col(1) = gradient2 * x.homogeneous();
  lifted.derivative.topRows<2>() += sample.depth * shape;
  return lifted;
}

}  // namespace

int OneAcDepthStep::Run(const PairInput& input, const PreparedPair& pair, int max_num_refined,
                        PoseSearch* search) {
  if (input.depth1.empty() || input.depth2.empty()) return 0;
  batch_.Reset(std::min(pair.size(), kMaxHypotheses));
  const bool umeyama = options_.depth_solver == "umeyama";
  int count = 0;
  hypotheses_.clear();
  for (int i = 0; i < pair.size() && count < batch_.size(); ++i) {
    const FeatureMatch& match = input.matches[pair.match_index[i]];
    const DepthSample& depth1 = input.depth1[match.point1];
    const DepthSample& depth2 = input.depth2[match.point2];
    if (!depth1.is_valid || !depth2.is_valid) continue;
    const Keypoint& keypoint1 = input.keypoints1[match.point1];
    const Keypoint& keypoint2 = input.keypoints2[match.point2];
    const LiftedFrame frame1 = Lift(*input.camera1, keypoint1, pair.points.Point1(i), depth1);
    const LiftedFrame frame2 = Lift(*input.camera2, keypoint2, pair.points.Point2(i), depth2);
    if (!umeyama) {
      batch_.Set(count++, frame1, frame2);
      continue;
    }
    const LiftedCorrespondence sample{frame1, frame2};
    ScaledPose model;
    ++count;
    if (OneAffineDepthUmeyama::Solve(&sample, &model) == 1 &&
        model.cam2_from_cam1.translation.norm() > 0.0) {
      hypotheses_.push_back(
          {model.cam2_from_cam1.RotationMatrix(), model.cam2_from_cam1.translation});
    }
  }
  if (!umeyama) {
    for (int i = count; i < batch_.size(); ++i) batch_.Set(i, {}, {});
    batch_.Solve();
    Hypothesis hypothesis;
    for (int i = 0; i < count; ++i) {
      if (batch_.Get(i, &hypothesis.R, &hypothesis.t)) hypotheses_.push_back(hypothesis);
    }
  }
  for (const Hypothesis& hypothesis : hypotheses_) {
    search->Add(CrossMatrix(hypothesis.t) * hypothesis.R);
  }
  search->RefineBest(max_num_refined);
  return count;
}

int OneAcDepthStep::CountRight(const Rigid3d& pose) const {
  const double min_trace = 1.0 + 2.0 * std::cos(DegToRad(20.0)),
               min_cosine = std::cos(DegToRad(15.0));
  const Eigen::Matrix3d R = pose.RotationMatrix();
  const Eigen::Vector3d direction = pose.translation.normalized();
  return static_cast<int>(
      std::count_if(hypotheses_.begin(), hypotheses_.end(), [&](const Hypothesis& hypothesis) {
        return hypothesis.R.cwiseProduct(R).sum() > min_trace &&
               hypothesis.t.dot(direction) > min_cosine * hypothesis.t.norm();
      }));
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
          NormalizeFrame(*input.camera1, input.keypoints1[match.point1], pair.points.Point1(i)),
          NormalizeFrame(*input.camera2, input.keypoints2[match.point2], pair.points.Point2(i))};
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
  Rng rng(input.seed, "cascade_five_point", input.pair_id);
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
