#include "two_view/calibrated_verifier.h"

#include <algorithm>
#include <cmath>

#include "two_view/decide/competing_model.h"
#include "two_view/decide/pair_outcome.h"
#include "two_view/search/pose_resampling.h"
#include "two_view/search/search_steps.h"

namespace cairn::internal {
namespace {

// Hypotheses of 1AC+D of a pair that are refined.
constexpr int kMaxNumRefined = 60;

// The steps of a pair's search and what came of them.
struct StepsTaken {
  std::string_view winner;  // the step that converged, or all of them
  int num_with_depth = 0;   // hypotheses of 1AC+D
};

StepsTaken RunSteps(const PreparedPair& pair, const SearchSteps& steps,
                    const TwoViewOptions& options, PoseSearch* search) {
  const bool has_depth = steps.one_ac_depth && pair.HasDepth();
  // Without frames, the cascade has triangles and five points, and no votes to order them.
  const bool has_frames = pair.has_frames || !steps.five_point;
  auto budget = [&](int full) {
    return static_cast<int>(std::ceil(pair.BudgetShare(options) * full));
  };
  StepsTaken taken{steps.name};
  auto end = [&](std::string_view step) {
    if (search->HasConverged()) taken.winner = step;
  };
  if (has_depth && has_frames) {
    taken.num_with_depth = RunOneAcDepthStep(pair, budget(kMaxNumRefined), search);
    end("one_ac_depth");
  }
  if (steps.triangles && has_depth && !search->HasConverged()) {
    RunTriangleStep(pair, options.max_depth_triangles, search);
    end("triangles");
  }
  if (steps.two_ac && has_frames && !search->HasConverged()) {
    RunTwoAcStep(pair, budget(options.max_affine_samples), search);
    end("two_ac");
  }
  if (steps.five_point && !search->HasConverged()) {
    const int num_samples = steps.uses_votes && has_frames ? budget(options.max_fallback_samples)
                                                           : options.max_iterations;
    RunFivePointStep(pair, num_samples, search);
    end("five_point");
  }
  return taken;
}

// A pair that has a second model as good keeps no pose (COLMAP's kMultiple).
void MarkCompeting(const PreparedPair& pair, const TwoViewOptions& options, PairReport* report) {
  TwoViewGeometry& geometry = report->geometry;
  const FeatureMatches others = FindCompetingModel(pair, *geometry.E, options);
  if (others.empty()) return;
  geometry.inlier_matches.insert(geometry.inlier_matches.end(), others.begin(), others.end());
  geometry.config = TwoViewConfig::kMultiple;
  geometry.cam2_from_cam1.reset();
  geometry.E.reset();
  geometry.F.reset();
  report->num_inliers = static_cast<int>(geometry.inlier_matches.size());
}

}  // namespace

PairReport VerifyCalibrated(const PreparedPair& pair, const SearchSteps& steps,
                            const TwoViewOptions& options) {
  PairReport report;
  PoseSearch search(pair, options);
  const StepsTaken taken = RunSteps(pair, steps, options, &search);
  report.verifier = taken.winner;
  report.num_iterations = search.num_hypotheses();
  if (!search.HasModel()) {
    const bool only_depth = steps.one_ac_depth && !steps.two_ac && !steps.five_point;
    report.status =
        only_depth && taken.num_with_depth == 0 ? PairStatus::kNoDepth : PairStatus::kNoModel;
    return report;
  }
  Rigid3d pose = search.best().pose;
  if (search.HasEvidence() && options.num_resamples > 0) {
    const ResamplingOptions resampling{.num_samples = options.num_resamples,
                                       .effort = steps.five_point ? 4 : 2};
    pose = ResamplePose(pair, search.best(), resampling, &report.num_iterations);
  }
  FinishPair(pair, options, pose, &report);
  if (report.geometry.config == TwoViewConfig::kCalibrated) MarkCompeting(pair, options, &report);
  return report;
}

}  // namespace cairn::internal
