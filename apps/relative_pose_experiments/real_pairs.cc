#include "relative_pose_experiments/real_pairs.h"

#include <algorithm>
#include <functional>
#include <limits>

#include "cairn/base/timer.h"
#include "cairn/evaluation/error_statistics.h"
#include "relative_pose_experiments/paper_estimator.h"

namespace cairn::experiments {
namespace {

std::function<PairReport(const PairInput&)> MakeEstimator(const std::string& name,
                                                          const TwoViewOptions& options) {
  const auto as_paper = [](MinimalSolver solver) {
    return [solver](const PairInput& input) { return EstimateAsPaper(input, solver); };
  };
  if (name == "1AC+D") return as_paper(MinimalSolver::kOneAffineDepth);
  if (name == "5PT") return as_paper(MinimalSolver::kFivePoint);
  const std::shared_ptr verifier = MakePairVerifier(VerifierKindFromName(name), options);
  return [verifier](const PairInput& input) { return verifier->Verify(input); };
}

PairResult RunEstimator(const std::string& name, const RealPair& pair, uint64_t seed,
                        const TwoViewOptions& options) {
  const PairInput input = InputOf(pair, seed);
  const auto estimate = MakeEstimator(name, options);
  PairReport report;
  double least_seconds = std::numeric_limits<double>::infinity();
  for (int run = 0; run < 3; ++run) {  // without what else the machine does
    const Timer timer;
    report = estimate(input);
    least_seconds = std::min(least_seconds, timer.Seconds());
  }
  PairResult result{.pair = &pair,
                    .estimator = name,
                    .num_inliers = report.num_inliers,
                    .num_iterations = report.num_iterations,
                    .ms = 1e3 * least_seconds};
  const auto& pose = report.geometry.cam2_from_cam1;
  result.has_pose = report.status == PairStatus::kVerified && pose;
  if (result.has_pose) result.errors = ErrorsOf(*pose, pair.cam2_from_cam1);
  return result;
}

}  // namespace

std::vector<PairResult> RunRealPairs(const RealScene& scene, const TwoViewOptions& verification,
                                     uint64_t seed, ProgressMonitor& monitor) {
  std::vector<PairResult> results;
  monitor.BeginStage("pairs", static_cast<int64_t>(scene.pairs.size()));
  for (const RealPair& pair : scene.pairs) {
    if (monitor.StopRequested()) break;
    for (const std::string& name : kRealEstimators) {
      results.push_back(RunEstimator(name, pair, seed, verification));
    }
    monitor.Advance(1);
  }
  monitor.EndStage();
  return results;
}

Results TabulatePairs(const std::vector<PairResult>& results, const RealDataOptions& data) {
  Results out;
  for (const PairResult& r : results) {
    out.tables["pairs"].AddRow({{"scene", data.scene},
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
    out.tables["pair_timings"].AddRow({{"scene", data.scene},
                                       {"depth", data.depth_name},
                                       {"estimator", r.estimator},
                                       {"name1", r.pair->image1->name},
                                       {"name2", r.pair->image2->name},
                                       {"ms", r.ms}});
  }
  for (const std::string& name : kRealEstimators) {
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
    const double rotation_deg = Median(rotation), translation_deg = Median(translation);
    out.tables["pairs_summary"].AddRow({{"scene", data.scene},
                                        {"depth", data.depth_name},
                                        {"estimator", name},
                                        {"pairs", pose.size()},
                                        {"with_pose", num_with_pose},
                                        {"rotation_median_deg", rotation_deg},
                                        {"translation_median_deg", translation_deg},
                                        {"auc_5", 100 * RecallAuc(pose, 5)},
                                        {"auc_10", 100 * RecallAuc(pose, 10)},
                                        {"auc_20", 100 * RecallAuc(pose, 20)},
                                        {"iterations_median", Median(iterations)}});
    out.checks.push_back({"pairs." + name + ".rotation_median_deg", rotation_deg, 0, 1});
    out.checks.push_back({"pairs." + name + ".translation_median_deg", translation_deg, 0, 1});
  }
  return out;
}

}  // namespace cairn::experiments
