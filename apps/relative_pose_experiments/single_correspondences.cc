#include <algorithm>

#include "cairn/base/parallel.h"
#include "cairn/geometry/epipolar.h"
#include "relative_pose_experiments/paper_estimator.h"
#include "relative_pose_experiments/real_pairs.h"
#include "robust/match_errors.h"

namespace cairn::experiments {
namespace {

struct Hypothesis {
  PoseErrors errors;
  int num_inliers = 0;
};

std::vector<Hypothesis> HypothesesOf(const RealPair& pair) {
  const internal::PreparedPair prepared = PrepareAsPaper(InputOf(pair, 0));
  MatchErrors errors;
  std::vector<Hypothesis> hypotheses;
  for (int i = 0; i < prepared.size(); ++i) {
    const auto pose = PoseFromOne(prepared, i);
    if (!pose) continue;
    errors.SetSampson(prepared.points, EssentialFromPose(*pose));
    hypotheses.push_back(
        {ErrorsOf(*pose, pair.cam2_from_cam1), errors.CountBelow(prepared.max_error_px)});
  }
  return hypotheses;
}

}  // namespace

SingleReport RunSingleCorrespondences(const RealScene& scene, int num_threads) {
  std::vector<std::vector<Hypothesis>> by_pair(scene.pairs.size());
  ParallelFor(num_threads, static_cast<int64_t>(scene.pairs.size()),
              [&](int64_t i) { by_pair[i] = HypothesesOf(scene.pairs[i]); });
  SingleReport report;
  int64_t num_six = 0, num_20_15 = 0, num_10_10 = 0;
  for (size_t i = 0; i < by_pair.size(); ++i) {
    report.num_matches += static_cast<int64_t>(scene.pairs[i].matches.size());
    for (const auto& [errors, num_inliers] : by_pair[i]) {
      num_six += num_inliers >= 6;
      num_20_15 += errors.rotation_deg <= 20 && errors.translation_deg <= 15;
      num_10_10 += errors.rotation_deg <= 10 && errors.translation_deg <= 10;
      report.rotation_deg.push_back(errors.rotation_deg);
      report.translation_deg.push_back(errors.translation_deg);
    }
  }
  const double n = static_cast<double>(std::max<int64_t>(report.num_matches, 1));
  report.share_six_inliers = num_six / n;
  report.share_within_20_15 = num_20_15 / n;
  report.share_within_10_10 = num_10_10 / n;
  return report;
}

Results TabulateSingle(const SingleReport& report, const RealDataOptions& data) {
  Results results;
  const size_t num_hypotheses = report.rotation_deg.size();
  results.tables["single"].AddRow({{"scene", data.scene},
                                   {"depth", data.depth_name},
                                   {"matches", report.num_matches},
                                   {"hypotheses", num_hypotheses},
                                   {"share_six_inliers", report.share_six_inliers},
                                   {"share_within_20_15", report.share_within_20_15},
                                   {"share_within_10_10", report.share_within_10_10}});
  const double with_hypothesis =
      static_cast<double>(num_hypotheses) / std::max<int64_t>(report.num_matches, 1);
  for (int degrees = 1; degrees <= 180; ++degrees) {
    results.tables["single_distribution"].AddRow(
        {{"scene", data.scene},
         {"depth", data.depth_name},
         {"matches", report.num_matches},
         {"degrees", degrees},
         {"rotation_share", with_hypothesis * ShareBelow(report.rotation_deg, degrees)},
         {"translation_share", with_hypothesis * ShareBelow(report.translation_deg, degrees)}});
  }
  results.checks = {{"single.share_six_inliers", report.share_six_inliers, 0.03, 1},
                    {"single.share_within_20_15", report.share_within_20_15, 0.05, 0.5}};
  return results;
}

}  // namespace cairn::experiments
