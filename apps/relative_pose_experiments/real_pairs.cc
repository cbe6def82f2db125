#include "relative_pose_experiments/real_pairs.h"

#include <algorithm>
#include <limits>

#include "cairn/base/timer.h"
#include "cairn/evaluation/pose_evaluation.h"
#include "relative_pose_experiments/statistics.h"

namespace cairn::experiments {
namespace {

// The time of a call without what else the machine does: the least of three, seconds.
template <class Fn>
double LeastSeconds(const Fn& fn) {
  double least = std::numeric_limits<double>::infinity();
  for (int run = 0; run < 3; ++run) {
    const Timer timer;
    fn();
    least = std::min(least, timer.Seconds());
  }
  return least;
}

PairResult RunPaperEstimator(const std::string& name, const RealPair& pair, uint64_t seed) {
  PairResult result{.pair = &pair, .estimator = name};
  const MinimalSolver solver =
      name == "5PT" ? MinimalSolver::kFivePoint : MinimalSolver::kOneAffineDepth;
  PaperEstimate estimate;
  result.ms =
      1e3 * LeastSeconds([&] { estimate = EstimateAsPaper(InputOf(pair, seed), solver, {}); });
  result.num_inliers = estimate.num_inliers;
  result.num_iterations = estimate.num_iterations;
  result.has_pose = estimate.cam2_from_cam1.has_value();
  if (result.has_pose) result.errors = ErrorsOf(*estimate.cam2_from_cam1, pair);
  return result;
}

PairResult RunVerifier(const std::string& name, const RealPair& pair, uint64_t seed,
                       TwoViewOptions options) {
  PairResult result{.pair = &pair, .estimator = name};
  const PairInput input = InputOf(pair, seed);
  if (options.max_error_px == 0) options.max_error_px = PaperThresholdPx(input, {});
  const auto verifier = MakePairVerifier(VerifierKindFromName(name), options);
  PairReport report;
  result.ms = 1e3 * LeastSeconds([&] { report = verifier->Verify(input); });
  result.num_inliers = report.num_inliers;
  result.num_iterations = report.num_iterations;
  result.has_pose =
      report.status == PairStatus::kVerified && report.geometry.cam2_from_cam1.has_value();
  if (result.has_pose) result.errors = ErrorsOf(*report.geometry.cam2_from_cam1, pair);
  return result;
}

std::vector<std::string> EstimatorsOf(const std::vector<PairResult>& results) {
  std::vector<std::string> names;
  for (const PairResult& result : results) {
    if (std::find(names.begin(), names.end(), result.estimator) == names.end()) {
      names.push_back(result.estimator);
    }
  }
  return names;
}

}  // namespace

std::vector<PairResult> RunRealPairs(const RealScene& scene, TwoViewOptions verification,
                                     uint64_t seed, ProgressMonitor& monitor) {
  std::vector<PairResult> results;
  monitor.BeginStage("pairs", static_cast<int64_t>(scene.pairs.size()));
  for (const RealPair& pair : scene.pairs) {
    if (monitor.StopRequested()) break;
    for (const std::string& name : kRealEstimators) {
      const bool is_papers = name == "1AC+D" || name == "5PT";
      results.push_back(is_papers ? RunPaperEstimator(name, pair, seed)
                                  : RunVerifier(name, pair, seed, verification));
    }
    monitor.Advance(1);
  }
  monitor.EndStage();
  return results;
}

Table PairTable(const std::vector<PairResult>& results, const RealDataOptions& data) {
  Table table;
  for (const PairResult& r : results) {
    table.AddRow({{"scene", data.scene},
                  {"depth", data.depth_name},
                  {"estimator", r.estimator},
                  {"name1", r.pair->image1->name},
                  {"name2", r.pair->image2->name},
                  {"matches", r.pair->matches.size()},
                  {"inliers", r.num_inliers},
                  {"iterations", r.num_iterations},
                  {"has_pose", int{r.has_pose}},
                  {"rotation_deg", r.errors.rotation_deg},
                  {"translation_deg", r.errors.translation_deg}});
  }
  return table;
}

Table PairSummaryTable(const std::vector<PairResult>& results, const RealDataOptions& data) {
  Table table;
  for (const std::string& name : EstimatorsOf(results)) {
    std::vector<double> rotation, translation, pose, iterations;
    int64_t num_with_pose = 0;
    for (const PairResult& r : results) {
      if (r.estimator != name) continue;
      num_with_pose += r.has_pose;
      rotation.push_back(r.errors.rotation_deg);
      translation.push_back(r.errors.translation_deg);
      pose.push_back(std::max(r.errors.rotation_deg, r.errors.translation_deg));
      iterations.push_back(static_cast<double>(r.num_iterations));
    }
    table.AddRow({{"scene", data.scene},
                  {"depth", data.depth_name},
                  {"estimator", name},
                  {"pairs", pose.size()},
                  {"with_pose", num_with_pose},
                  {"rotation_median_deg", Median(rotation)},
                  {"translation_median_deg", Median(translation)},
                  {"auc_5", 100 * RecallAuc(pose, 5)},
                  {"auc_10", 100 * RecallAuc(pose, 10)},
                  {"auc_20", 100 * RecallAuc(pose, 20)},
                  {"iterations_median", Median(iterations)}});
  }
  return table;
}

Table PairTimeTable(const std::vector<PairResult>& results, const RealDataOptions& data) {
  Table table;
  for (const PairResult& r : results) {
    table.AddRow({{"scene", data.scene},
                  {"depth", data.depth_name},
                  {"estimator", r.estimator},
                  {"name1", r.pair->image1->name},
                  {"name2", r.pair->image2->name},
                  {"ms", r.ms}});
  }
  return table;
}

std::vector<FigureCheck> Checks(const std::vector<PairResult>& results) {
  std::vector<FigureCheck> checks;
  for (const std::string& name : EstimatorsOf(results)) {
    std::vector<double> rotation, translation;
    for (const PairResult& r : results) {
      if (r.estimator != name) continue;
      rotation.push_back(r.errors.rotation_deg);
      translation.push_back(r.errors.translation_deg);
    }
    checks.push_back({"pairs." + name + ".rotation_median_deg", Median(rotation), 0, 1});
    checks.push_back({"pairs." + name + ".translation_median_deg", Median(translation), 0, 1});
  }
  return checks;
}

}  // namespace cairn::experiments
