#include "two_view/one_ac_depth_verifier.h"

#include <algorithm>

#include "cairn/geometry/epipolar.h"
#include "cairn/robust/pose_refinement.h"
#include "cairn/solvers/one_affine_depth.h"

namespace cairn::internal {

void OneAcDepthVerifier::GenerateHypotheses(const PairInput& input) {
  hypotheses_.clear();
  const bool proposed = options_.depth_solver == "proposed";
  for (int i = 0; i < pair_.size(); ++i) {
    const FeatureMatch& match = input.matches[pair_.match_index[i]];
    const DepthSample& depth1 = input.depth1[match.point1];
    const DepthSample& depth2 = input.depth2[match.point2];
    if (!depth1.is_valid || !depth2.is_valid) continue;
    const Keypoint& keypoint1 = input.keypoints1[match.point1];
    const Keypoint& keypoint2 = input.keypoints2[match.point2];
    const auto frame1 = LiftFrame(*input.camera1, keypoint1.Position(), keypoint1.Shape(),
                                  depth1.depth, {depth1.ddepth_dx, depth1.ddepth_dy});
    const auto frame2 = LiftFrame(*input.camera2, keypoint2.Position(), keypoint2.Shape(),
                                  depth2.depth, {depth2.ddepth_dx, depth2.ddepth_dy});
    if (!frame1 || !frame2) continue;
    const LiftedCorrespondence sample{*frame1, *frame2};
    ScaledPose model;
    const int count = proposed ? OneAffineDepthProposed::Solve(&sample, &model)
                               : OneAffineDepthUmeyama::Solve(&sample, &model);
    const double norm = model.cam2_from_cam1.translation.norm();
    if (count == 0 || !(norm > 0.0)) continue;
    Hypothesis hypothesis;
    hypothesis.pose =
        Rigid3d(model.cam2_from_cam1.rotation, model.cam2_from_cam1.translation / norm);
    hypothesis.support = SoftScoreSampson(pair_.points, EssentialFromPose(hypothesis.pose),
                                          options_.rough_error_ratio * pair_.max_error_px);
    hypotheses_.push_back(hypothesis);
  }
  std::stable_sort(hypotheses_.begin(), hypotheses_.end(),
                   [](const Hypothesis& a, const Hypothesis& b) { return a.support > b.support; });
}

PairReport OneAcDepthVerifier::Verify(const PairInput& input) {
  PairReport report;
  report.verifier = "one_ac_depth";
  if (static_cast<int>(input.matches.size()) < options_.min_num_matches) {
    report.status = PairStatus::kTooFewMatches;
    return report;
  }
  if (input.depth1.empty() || input.depth2.empty()) {
    report.status = PairStatus::kNoDepth;
    return report;
  }
  PreparePair(input, options_, &pair_);
  GenerateHypotheses(input);
  report.num_iterations = static_cast<int64_t>(hypotheses_.size());
  if (hypotheses_.empty()) {
    report.status = PairStatus::kNoDepth;
    return report;
  }
  const size_t num_refined =
      std::min(hypotheses_.size(), static_cast<size_t>(options_.max_num_refined));
  Rigid3d best;
  double best_score = -1.0;
  for (size_t k = 0; k < num_refined; ++k) {
    Rigid3d pose = hypotheses_[k].pose;
    for (const double scale : {8.0, 3.0, 1.0}) {
      PoseRefinementOptions refinement;
      refinement.loss = scale > 1.0 ? RobustLoss::kGemanMcClure : RobustLoss::kTruncated;
      refinement.scale_px = scale * pair_.max_error_px;
      refinement.max_iterations = 10;
      pose = RefinePose(pair_.points, pose, refinement).cam2_from_cam1;
    }
    const double score =
        ScoreSampson(pair_.points, EssentialFromPose(pose), pair_.max_error_px, best_score);
    if (score > best_score) {
      best_score = score;
      best = pose;
    }
  }
  if (best_score < 0.0) {
    report.status = PairStatus::kNoModel;
    return report;
  }
  FinishPair(input, pair_, options_, best, &scratch_, &report);
  return report;
}

}  // namespace cairn::internal
