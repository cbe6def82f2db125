#include "relative_pose_experiments/reconstruction_table.h"

#include <filesystem>

#include "cairn/base/file.h"
#include "cairn/base/timer.h"
#include "cairn/database/database.h"
#include "cairn/io/model.h"
#include "cairn/pipeline/pair_scheduler.h"
#include "cairn/pipeline/reconstruct.h"

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

void RemoveDatabase(const std::string& path) {
  for (const char* suffix : {"", "-wal", "-shm"}) std::filesystem::remove(path + suffix);
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
                                                     const TwoViewOptions& verification,
                                                     const std::vector<std::string>& verifiers,
                                                     const std::string& work_path, uint64_t seed,
                                                     int num_threads, ProgressMonitor& monitor) {
  const RealScene scene =
      LoadRealScene(options, depth_options, verification.min_num_matches, monitor);
  const Database source(options.database_path, Database::Mode::kReadOnly);
  const PosedCameras reference =
      PosedCamerasOf(ReadModel(options.reference_path, {.read_points = false}));
  CreateFolders(work_path);
  std::vector<ReconstructionResult> results;
  for (const std::string& verifier : verifiers) {
    ReconstructionResult result;
    result.verifier = verifier;
    const std::string path = work_path + "/" + options.scene + "." + verifier + ".db";
    RemoveDatabase(path);
    {
      Database database(path);
      CopyInputs(source, scene, &database);
      VerificationInput input;
      input.seed = seed;
      input.min_num_matches = verification.min_num_matches;
      const Timer timer;
      const VerificationReport report = VerifyPairs(database, MakeVerifiers(verifier, verification),
                                                    input, {}, num_threads, monitor);
      result.verification_seconds = timer.Seconds();
      result.num_verified_pairs = static_cast<int>(report.counts.num_verified);
      ReconstructSettings settings;
      settings.seed = seed;
      settings.num_threads = num_threads;
      settings.reconstruct.colors = false;
      const Timer reconstruction_timer;
      const ReconstructResult reconstructed = ReconstructScene(database, "", settings, monitor);
      result.reconstruction_seconds = reconstruction_timer.Seconds();
      result.failure = reconstructed.report.failure;
      if (!reconstructed.models.empty()) {
        result.evaluation = EvaluatePoses(PosedCamerasOf(reconstructed.models[0]), reference);
      }
    }
    RemoveDatabase(path);
    results.push_back(std::move(result));
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

}  // namespace cairn::experiments
