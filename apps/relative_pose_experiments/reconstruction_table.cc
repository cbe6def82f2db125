#include "relative_pose_experiments/reconstruction_table.h"

#include "cairn/base/file.h"
#include "cairn/base/timer.h"
#include "cairn/database/database.h"
#include "cairn/io/model.h"
#include "cairn/mapper/reconstruct.h"
#include "cairn/pipeline/verify_pairs.h"
#include "relative_pose_experiments/least_time.h"
#include "relative_pose_experiments/remove_database.h"

namespace cairn::experiments {
namespace {

// A fresh database with everything but what verification makes.
void CopyInputs(const Database& from, const RealScene& scene, Database* to) {
  Database::Transaction transaction(*to);
  for (const Camera& camera : from.ReadCameras()) to->WriteCamera(camera);
  for (const Image& image : from.ReadImages()) {
    to->WriteImage(image);
    const auto it = scene.images.find(image.image_id);
    if (it == scene.images.end()) continue;
    to->WriteKeypoints(image.image_id, it->second.keypoints);
    if (!it->second.depth.empty()) to->WriteDepthSamples(image.image_id, it->second.depth);
  }
  for (const image_pair_t pair_id : from.ReadMatchedPairIds()) {
    to->WriteMatches(pair_id, *from.ReadMatches(pair_id));
  }
  transaction.Commit();
}

ReconstructionResult VerifyAndReconstruct(const std::string& verifier,
                                          const ReconstructionSettings& settings,
                                          const PosedCameras& reference, Database& database,
                                          ProgressMonitor& monitor) {
  ReconstructionResult result;
  result.verifier = verifier;
  VerificationInput input;
  input.min_num_matches = settings.verification.min_num_matches;
  const Timer timer;
  const VerificationReport report =
      VerifyPairs(database, MakeVerifiers(verifier, settings.verification), input, {},
                  {settings.seed, settings.num_threads, monitor});
  result.verification_seconds = timer.Seconds();
  result.num_verified_pairs = static_cast<int>(report.counts.num_verified);

  ReconstructSettings reconstruct;
  reconstruct.refine_intrinsics = settings.refine_intrinsics;
  reconstruct.reconstruct.colors = false;
  // One thread of bundle adjustment, for equal bytes in every run.
  const RunContext run = {.seed = settings.seed, .num_threads = 1};
  ReconstructResult reconstructed;
  result.reconstruction_seconds =
      LeastSeconds([&] { reconstructed = Reconstruct(database, "", reconstruct, run); });
  result.failure = reconstructed.report.failure;
  if (!reconstructed.models.empty()) {
    result.evaluation = EvaluatePoses(PosedCamerasOf(reconstructed.models[0]), reference);
  }
  return result;
}

void AddStatistics(const std::optional<ErrorStatistics>& statistics, double factor, Table* table) {
  if (statistics && statistics->count > 0) {
    table->Add(factor * statistics->mean)
        .Add(factor * statistics->median)
        .Add(factor * statistics->standard_deviation);
  } else {
    table->Add("-").Add("-").Add("-");
  }
}

}  // namespace

std::vector<ReconstructionResult> RunReconstructions(const RealDataOptions& options,
                                                     const DepthOptions& depth_options,
                                                     const ReconstructionSettings& settings,
                                                     ProgressMonitor& monitor) {
  const RealScene scene =
      LoadRealScene(options, depth_options, settings.verification.min_num_matches, monitor);
  const Database source(options.database_path, Database::Mode::kReadOnly);
  // Points of 1DSfM's references cannot be read (io/bundler.h).
  const PosedCameras reference =
      PosedCamerasOf(ReadModel(options.reference_path, {.read_points = false}));
  CreateFolders(settings.work_path);
  std::vector<ReconstructionResult> results;
  for (const std::string& verifier : settings.verifiers) {
    if (monitor.StopRequested()) break;
    const std::string path = settings.work_path + "/" + options.scene + "." + verifier + ".db";
    RemoveDatabase(path);
    {
      Database database(path);
      CopyInputs(source, scene, &database);
      results.push_back(VerifyAndReconstruct(verifier, settings, reference, database, monitor));
    }
    RemoveDatabase(path);
  }
  return results;
}

Table ReconstructionTable(const std::vector<ReconstructionResult>& results,
                          const RealDataOptions& data) {
  Table table({"scene", "depth", "verifier", "verified_pairs", "registered", "reference",
               "orientation_avg_deg", "orientation_med_deg", "orientation_std_deg", "position_avg",
               "position_med", "position_std", "focal_avg_percent", "focal_med_percent",
               "focal_std_percent", "auc_1", "auc_5"});
  for (const ReconstructionResult& r : results) {
    const PoseEvaluation& e = r.evaluation;
    table.Row().Add(data.scene).Add(data.depth_name).Add(r.verifier).Add(r.num_verified_pairs);
    table.Add(e.num_registered).Add(e.num_reference);
    AddStatistics(e.orientation_deg, 1.0, &table);
    AddStatistics(e.center, 1.0, &table);
    AddStatistics(e.focal_relative, 100.0, &table);
    table.Add(100.0 * e.auc[0]).Add(100.0 * e.auc[2]);
  }
  return table;
}

Table ReconstructionTimeTable(const std::vector<ReconstructionResult>& results,
                              const RealDataOptions& data) {
  Table table({"scene", "depth", "verifier", "verification_s", "reconstruction_s"});
  for (const ReconstructionResult& r : results) {
    table.Row()
        .Add(data.scene)
        .Add(data.depth_name)
        .Add(r.verifier)
        .Add(r.verification_seconds)
        .Add(r.reconstruction_seconds);
  }
  return table;
}

std::vector<FigureCheck> Checks(const std::vector<ReconstructionResult>& results) {
  std::vector<FigureCheck> checks;
  for (const ReconstructionResult& r : results) {
    const PoseEvaluation& e = r.evaluation;
    const auto add = [&](const std::string& figure, double value, double min, double max) {
      checks.push_back({"reconstruction." + r.verifier + "." + figure, value, min, max});
    };
    const auto median = [](const std::optional<ErrorStatistics>& s) { return s ? s->median : 1e9; };
    add("registered", e.num_registered, e.num_reference, e.num_reference);
    add("orientation_med_deg", median(e.orientation_deg), 0, 0.2);
    add("position_med", median(e.center), 0, 0.02);  // the scene's radius is 1
    add("focal_med", median(e.focal_relative), 0, 0.02);
  }
  return checks;
}

}  // namespace cairn::experiments
