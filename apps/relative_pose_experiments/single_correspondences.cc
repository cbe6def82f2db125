#include <algorithm>

#include "cairn/base/parallel.h"
#include "cairn/geometry/epipolar.h"
#include "relative_pose_experiments/real_pairs.h"
#include "relative_pose_experiments/statistics.h"
#include "robust/sampson_kernels.h"

namespace cairn::experiments {
namespace {

struct Hypothesis {
  RelativeErrors errors;
  int num_inliers = 0;
};

std::vector<Hypothesis> HypothesesOf(const RealPair& pair) {
  const PairInput input = InputOf(pair, 0);
  const NormalizedMatches matches(input);
  const double max_error_px = PaperThresholdPx(input, {});
  std::vector<float> errors(matches.points().num_blocks() * PointPairs::kBlock);
  std::vector<Hypothesis> hypotheses;
  for (int i = 0; i < matches.size(); ++i) {
    const auto pose = matches.PoseFromOne(i);
    if (!pose) continue;
    SampsonErrors(matches.points(), EssentialFromPose(*pose), errors.data());
    const auto num_inliers =
        std::count_if(errors.begin(), errors.begin() + matches.size(),
                      [max_error_px](float error) { return error < max_error_px; });
    hypotheses.push_back({ErrorsOf(*pose, pair), static_cast<int>(num_inliers)});
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
    for (const Hypothesis& h : by_pair[i]) {
      ++report.num_hypotheses;
      num_six += h.num_inliers >= 6;
      num_20_15 += h.errors.rotation_deg <= 20 && h.errors.translation_deg <= 15;
      num_10_10 += h.errors.rotation_deg <= 10 && h.errors.translation_deg <= 10;
      report.rotation_deg.push_back(h.errors.rotation_deg);
      report.translation_deg.push_back(h.errors.translation_deg);
    }
  }
  const double n = static_cast<double>(std::max<int64_t>(report.num_matches, 1));
  report.share_six_inliers = num_six / n;
  report.share_within_20_15 = num_20_15 / n;
  report.share_within_10_10 = num_10_10 / n;
  return report;
}

std::vector<FigureCheck> Checks(const SingleReport& report) {
  return {{"single.share_six_inliers", report.share_six_inliers, 0.03, 1},
          {"single.share_within_20_15", report.share_within_20_15, 0.05, 0.5}};
}

Table SingleSummaryTable(const SingleReport& report, const RealDataOptions& data) {
  Table table;
  table.AddRow({{"scene", data.scene},
                {"depth", data.depth_name},
                {"matches", report.num_matches},
                {"hypotheses", report.num_hypotheses},
                {"share_six_inliers", report.share_six_inliers},
                {"share_within_20_15", report.share_within_20_15},
                {"share_within_10_10", report.share_within_10_10}});
  return table;
}

Table SingleDistributionTable(const SingleReport& report, const RealDataOptions& data) {
  Table table;
  const double with_hypothesis =
      static_cast<double>(report.num_hypotheses) / std::max<int64_t>(report.num_matches, 1);
  for (int degrees = 1; degrees <= 180; ++degrees) {
    table.AddRow(
        {{"scene", data.scene},
         {"depth", data.depth_name},
         {"matches", report.num_matches},
         {"degrees", degrees},
         {"rotation_share", with_hypothesis * ShareBelow(report.rotation_deg, degrees)},
         {"translation_share", with_hypothesis * ShareBelow(report.translation_deg, degrees)}});
  }
  return table;
}

}  // namespace cairn::experiments
