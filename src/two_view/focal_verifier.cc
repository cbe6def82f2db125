#include "two_view/focal_verifier.h"

#include <Eigen/LU>
#include <algorithm>
#include <utility>

#include "cairn/geometry/epipolar.h"
#include "robust/match_errors.h"
#include "two_view/decide/evidence.h"
#include "two_view/decide/focal_evidence.h"
#include "two_view/decide/special_pairs.h"

namespace cairn::internal {
namespace {

bool HasPose(const PairReport& report) {
  return report.status == PairStatus::kVerified &&
         report.geometry.config == TwoViewConfig::kCalibrated;
}

bool AreTrusted(const PairInput& input) {
  return input.camera1->has_prior_focal_length && input.camera2->has_prior_focal_length;
}

// Whether a quarter of the matches and more are off by one shift: so are marks that repeat, but not
// the points of a scene.
bool HaveOneShift(const PairInput& input, std::span<const FeatureMatch> matches,
                  double max_error_px) {
  constexpr ptrdiff_t kMaxTried = 200;
  const ptrdiff_t step = 1 + std::ssize(matches) / kMaxTried;
  for (ptrdiff_t i = 0; i < std::ssize(matches); i += step) {
    const Eigen::Vector2d shift = ShiftOf(input, matches[i]);
    const auto num_equal = std::ranges::count_if(matches, [&](const FeatureMatch& match) {
      return (ShiftOf(input, match) - shift).norm() < max_error_px;
    });
    if (4 * num_equal >= std::ssize(matches)) return true;
  }
  return false;
}

// E is of a guess.
PairReport WithoutEssential(PairReport report) {
  report.geometry.config = TwoViewConfig::kUncalibrated;
  report.geometry.E.reset();
  return report;
}

}  // namespace

PairReport FocalVerifier::Verify(const PairInput& input) {
  PairReport report = VerifyMatches(input);
  if (!options_.detect_watermark || report.status != PairStatus::kVerified) return report;
  return LookUnderOverlay(input, std::move(report));
}

PairReport FocalVerifier::LookUnderOverlay(const PairInput& input, PairReport report) {
  const double max_error_px = pair_.max_error_px;
  const auto shift = OverlayShift(input, report.geometry.inlier_matches, max_error_px);
  if (!shift) return report;
  FeatureMatches others;
  for (const FeatureMatch& match : input.matches) {
    const bool is_still = (ShiftOf(input, match) - *shift).norm() < kOutside * max_error_px;
    if (!is_still) others.push_back(match);
  }
  PairInput part = input;
  part.matches = others;
  PairReport under = VerifyMatches(part);
  if (under.status != PairStatus::kVerified ||
      !EssentialOf(under.geometry, *input.camera1, *input.camera2)) {
    return report;
  }
  // (What lies under is checked by itself alone: at equal rotations, its E explains the overlay.
  // Marks are equal pixels, and found more exactly than points of a scene.)
  return HaveOneShift(input, under.geometry.inlier_matches, 0.5 * max_error_px) ? report : under;
}

PairReport FocalVerifier::VerifyMatches(const PairInput& input) {
  if (static_cast<int>(input.matches.size()) < options_.min_num_matches) {
    PairReport report;
    report.verifier = steps_.name;
    report.status = PairStatus::kTooFewMatches;
    return report;
  }
  PreparePair(input, options_, steps_.uses_votes ? MatchOrder::kByConsensus : MatchOrder::kGiven,
              &pair_);
  PairReport report = VerifyCalibrated(pair_, steps_, options_);
  // Without its focal length, a wide camera's rays are not even a linear map of the right ones:
  // there is no fundamental matrix to fall back on, or to compare with.
  const bool is_wide = pair_.points.is_wide();
  // (At wrong focal lengths, what E explains of a scene may be one of its planes.)
  const bool weighs = input.weigh_focals && AreTrusted(input) && !is_wide && report.geometry.E;
  const bool needs_fundamental = !is_wide && NeedsFundamental(report);
  if (!steps_.uses_votes && (weighs || needs_fundamental)) {
    PreparePair(input, options_, MatchOrder::kByConsensus, &pair_);
  }
  if (weighs) report.focal_evidence = WeighFocals(pair_, *report.geometry.E, options_);
  if (needs_fundamental) return Judge(std::move(report));
  const bool is_of_guess = is_wide && !AreTrusted(input) && HasPose(report);
  return is_of_guess ? WithoutEssential(std::move(report)) : report;
}

bool FocalVerifier::NeedsFundamental(const PairReport& report) const {
  if (report.status == PairStatus::kDegenerate) return false;
  if (report.status != PairStatus::kVerified) return searches_ && !AreTrusted(pair_.input);
  // Planes and rotations have no fundamental matrix of their own, but things before a plane give
  // one, and without focal lengths nothing else tells the motion; two models may be one.
  switch (report.geometry.config) {
    case TwoViewConfig::kMultiple:
      return true;
    case TwoViewConfig::kCalibrated:
      return !AreTrusted(pair_.input) || report.may_have_wrong_focal;
    case TwoViewConfig::kPlanar:
      return !AreTrusted(pair_.input);
    default:
      return false;
  }
}

PairReport FocalVerifier::Judge(PairReport report) const {
  const bool is_trusted = AreTrusted(pair_.input);
  std::optional<FundamentalModel> model = Find(report);
  if (!model) {
    // What E explains is no more than chance for F, but E is of a guess all the same.
    return !is_trusted && HasPose(report) ? WithoutEssential(std::move(report)) : report;
  }
  if (report.geometry.config == TwoViewConfig::kPlanar) {
    const Eigen::Matrix3d H = pair_.input.camera2->CalibrationMatrix().inverse() *
                              *report.geometry.H * pair_.input.camera1->CalibrationMatrix();
    const double noise_px = 0.5 * pair_.max_error_px;  // planes are not exact
    if (!HasParallax(pair_, H, model->inliers, noise_px, options_.min_log10_evidence)) {
      return report;
    }
  }
  const bool is_ambiguous = report.geometry.config == TwoViewConfig::kMultiple;
  const auto num_inliers = static_cast<double>(model->inliers.size());
  if (is_ambiguous && num_inliers < options_.min_calibrated_share * report.num_inliers) {
    return report;
  }
  const bool is_wrong =
      is_ambiguous || report.num_inliers < options_.min_calibrated_share * num_inliers;
  if (is_trusted && !is_wrong) return report;
  if (is_trusted) {
    auto improved = ImproveFundamental(pair_, model->F);
    if (improved) model = std::move(improved);
  }
  Fill(*model, &report);
  return report;
}

std::optional<FundamentalModel> FocalVerifier::FindFromNothing() const {
  const int budget = options_.max_fallback_samples;
  return FindFundamental(
      pair_, {.confidence = options_.confidence,
              .min_iterations = std::min(options_.min_iterations, budget),
              .max_iterations = static_cast<int>(pair_.BudgetShare(options_) * budget)});
}

std::optional<FundamentalModel> FocalVerifier::Find(const PairReport& report) const {
  const bool has_essential = report.status == PairStatus::kVerified && report.geometry.E;
  const bool is_trusted = AreTrusted(pair_.input);
  auto model = has_essential ? RefineFundamental(pair_, *report.geometry.E) : FindFromNothing();
  // An essential matrix at a guessed focal length may be too far away to start from. (Trusted ones
  // keep it: among right matches of one surface, a search from scratch finds an F that fits more.)
  if (HasPose(report) && report.may_have_wrong_focal && !is_trusted) {
    auto found = FindFromNothing();
    if (found && (!model || found->inliers.size() > model->inliers.size())) {
      model = std::move(found);
    }
  }
  // It takes time that trusted ones are spared until they are known to be wrong.
  if (model && !is_trusted) model = ImproveFundamental(pair_, model->F);
  if (!model || static_cast<int>(model->inliers.size()) < options_.min_num_inliers ||
      !(model->log10_nfa < -options_.min_log10_evidence)) {
    return std::nullopt;
  }
  return model;
}

void FocalVerifier::Fill(const FundamentalModel& model, PairReport* report) const {
  TwoViewGeometry& geometry = report->geometry;
  report->status = PairStatus::kVerified;
  geometry.E.reset();  // It stands and falls with the focal lengths.
  if (options_.detect_watermark &&
      OverlayShift(pair_.input, pair_.Matches(model.inliers), pair_.max_error_px)) {
    geometry.config = TwoViewConfig::kWatermark;
    geometry.cam2_from_cam1.reset();
    geometry.F.reset();
    geometry.H.reset();
  } else {
    geometry.config = TwoViewConfig::kUncalibrated;
    geometry.F = FundamentalFromEssential(model.F, pair_.input.camera1->CalibrationMatrix(),
                                          pair_.input.camera2->CalibrationMatrix());
  }
  geometry.inlier_matches = pair_.Matches(model.inliers);
  report->num_inliers = static_cast<int>(model.inliers.size());
  report->score = ScoreSampson(pair_.points, model.F, pair_.max_error_px);
  report->residual_px = MatchErrors(pair_.points, model.F).MedianOf(model.inliers);
}

}  // namespace cairn::internal
