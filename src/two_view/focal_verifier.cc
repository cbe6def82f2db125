#include "two_view/focal_verifier.h"

#include <Eigen/LU>
#include <algorithm>
#include <utility>

#include "cairn/robust/sampson_kernels.h"
#include "two_view/decide/evidence.h"
#include "two_view/decide/focal_plausibility.h"
#include "two_view/decide/special_pairs.h"

namespace cairn::internal {
namespace {

constexpr int kMaxProposals = 3;

bool HasPose(const PairReport& report) {
  return report.status == PairStatus::kVerified &&
         report.geometry.config == TwoViewConfig::kCalibrated;
}

}  // namespace

PairReport FocalVerifier::Verify(const PairInput& input) {
  PairReport report = calibrated_->Verify(input);
  pair_ = calibrated_->pair_by_consensus();
  const bool is_trusted =
      input.camera1->has_prior_focal_length && input.camera2->has_prior_focal_length;
  // Without its focal length, a wide camera's rays are not even a linear map of the right ones:
  // there is no fundamental matrix to fall back on, or to compare with.
  const bool is_wide = !input.camera1->IsPlanar() || !input.camera2->IsPlanar();
  // (At wrong focal lengths, what E explains of a scene may be one of its planes.)
  if (input.weigh_focals && is_trusted && !is_wide && report.geometry.E) {
    if (pair_ == nullptr) Prepare(input);
    report.focal_evidence = weigher_.Weigh(input, *pair_, *report.geometry.E);
  }
  if (report.status == PairStatus::kTooFewMatches || report.status == PairStatus::kDegenerate) {
    return report;
  }
  if (is_wide) {
    if (!is_trusted && HasPose(report)) {
      report.geometry.config = TwoViewConfig::kUncalibrated;
      report.geometry.E.reset();
    }
    return report;
  }
  if (!searches_ && report.status != PairStatus::kVerified) return report;
  // Planes and rotations have no fundamental matrix of their own, but things before a plane give
  // one, and without focal lengths nothing else tells the motion; two models may be one.
  const bool is_ambiguous = report.geometry.config == TwoViewConfig::kMultiple;
  const bool is_planar = report.geometry.config == TwoViewConfig::kPlanar && !is_trusted;
  if (report.status == PairStatus::kVerified && !HasPose(report) && !is_ambiguous && !is_planar) {
    return report;
  }
  if (is_trusted && !is_ambiguous && !report.may_have_wrong_focal) return report;
  if (pair_ == nullptr) Prepare(input);
  std::optional<FundamentalModel> model = Find(input, report);
  if (!model) {
    // What E explains is no more than chance for F, but E is of a guess all the same.
    if (!is_trusted && HasPose(report)) {
      report.geometry.config = TwoViewConfig::kUncalibrated;
      report.geometry.E.reset();
    }
    return report;
  }
  if (is_planar && !HasParallax(input, *model, *report.geometry.H)) return report;
  const auto num_inliers = static_cast<double>(model->inliers.size());
  if (is_ambiguous && num_inliers < options_.min_calibrated_share * report.num_inliers) {
    return report;
  }
  const bool is_wrong =
      is_ambiguous || report.num_inliers < options_.min_calibrated_share * num_inliers;
  if (is_trusted && !is_wrong) return report;
  if (is_trusted) {
    auto improved = ImproveFundamental(input, *pair_, model->F);
    if (improved) model = std::move(improved);
  }
  // A pose at other focal lengths would mean nothing beside cameras that are trusted.
  if (is_wrong && !is_trusted) {
    if (pair_ != &own_pair_) Prepare(input);
    report = TryFocals(input, report, model->F);
  }
  Fill(input, *model, &report);
  return report;
}

void FocalVerifier::Prepare(const PairInput& input) {
  PreparePair(input, options_, MatchOrder::kByConsensus, &own_pair_);
  pair_ = &own_pair_;
}

std::optional<FundamentalModel> FocalVerifier::Find(const PairInput& input,
                                                    const PairReport& report) const {
  const bool has_essential = report.status == PairStatus::kVerified && report.geometry.E;
  auto model = has_essential ? RefineFundamental(*pair_, *report.geometry.E)
                             : FindFundamental(input, *pair_, options_);
  // An essential matrix at a guessed focal length may be too far away to start from. (Trusted ones
  // keep it: among right matches of one surface, a search from scratch finds an F that fits more.)
  const bool is_trusted =
      input.camera1->has_prior_focal_length && input.camera2->has_prior_focal_length;
  if (HasPose(report) && report.may_have_wrong_focal && !is_trusted) {
    auto found = FindFundamental(input, *pair_, options_);
    if (found && (!model || found->inliers.size() > model->inliers.size())) {
      model = std::move(found);
    }
  }
  // It takes time that trusted ones are spared until they are known to be wrong.
  if (model && !is_trusted) model = ImproveFundamental(input, *pair_, model->F);
  if (!model || static_cast<int>(model->inliers.size()) < options_.min_num_inliers ||
      !(model->log10_nfa < -options_.min_log10_evidence)) {
    return std::nullopt;
  }
  return model;
}

bool FocalVerifier::HasParallax(const PairInput& input, const FundamentalModel& model,
                                const Eigen::Matrix3d& pixels_H) const {
  const Eigen::Matrix3d H =
      input.camera2->CalibrationMatrix().inverse() * pixels_H * input.camera1->CalibrationMatrix();
  constexpr double kOffPlane = 4.0;  // thresholds: not merely the noise of the plane
  constexpr int kSampleSize = 2, kNumModels = 1;
  std::vector<float> errors(pair_->points.num_blocks() * PointPairs::kBlock);
  HomographyErrors(pair_->points, H, errors.data());
  auto is_off_plane = [&](float error) { return error > kOffPlane * pair_->max_error_px; };
  const auto num_off_plane =
      std::count_if(errors.begin(), errors.begin() + pair_->size(), is_off_plane);
  const auto num_explained = std::count_if(model.inliers.begin(), model.inliers.end(),
                                           [&](int32_t i) { return is_off_plane(errors[i]); });
  const double chance = pair_->chance_per_px * pair_->max_error_px;
  return Log10NumFalseAlarms(static_cast<int>(num_off_plane), static_cast<int>(num_explained),
                             kSampleSize, kNumModels, chance) < -options_.min_log10_evidence;
}

PairReport FocalVerifier::TryFocals(const PairInput& input, const PairReport& guess,
                                    const Eigen::Matrix3d& F) {
  PairReport best = guess;
  int64_t num_iterations = guess.num_iterations;
  const auto proposals = ProposeFocals(F, *input.camera1, *input.camera2, kMaxProposals);
  for (const Eigen::Vector2d& factors : proposals) {
    Camera camera1 = *input.camera1, camera2 = *input.camera2;
    camera1.SetMeanFocal(factors[0] * camera1.MeanFocal());
    camera2.SetMeanFocal(factors[1] * camera2.MeanFocal());
    PairInput scaled = input;
    scaled.camera1 = &camera1;
    scaled.camera2 = &camera2;
    PairReport report = calibrated_->Verify(scaled);
    num_iterations += report.num_iterations;
    if (HasPose(report) && (!HasPose(best) || report.score > best.score)) best = std::move(report);
  }
  best.num_iterations = num_iterations;
  return best;
}

void FocalVerifier::Fill(const PairInput& input, const FundamentalModel& model,
                         PairReport* report) const {
  TwoViewGeometry& geometry = report->geometry;
  report->status = PairStatus::kVerified;
  geometry.E.reset();  // It stands and falls with the focal lengths.
  if (options_.detect_watermark && IsOverlay(input, *pair_, model.inliers)) {
    geometry.config = TwoViewConfig::kWatermark;
    geometry.cam2_from_cam1.reset();
    geometry.F.reset();
    geometry.H.reset();
  } else {
    geometry.config = TwoViewConfig::kUncalibrated;
    geometry.F = input.camera2->CalibrationMatrix().inverse().transpose() * model.F *
                 input.camera1->CalibrationMatrix().inverse();
  }
  geometry.inlier_matches.clear();
  for (const int32_t i : model.inliers) {
    geometry.inlier_matches.push_back(input.matches[pair_->match_index[i]]);
  }
  report->num_inliers = static_cast<int>(model.inliers.size());
  report->score = ScoreSampson(pair_->points, model.F, pair_->max_error_px);
}

}  // namespace cairn::internal
