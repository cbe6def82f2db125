#include "cairn/pipeline/build_pipeline.h"

#include <cstdio>

#include "cairn/base/error.h"
#include "cairn/graph/graph.h"
#include "pipeline/recompute.h"
#include "pipeline/stage_ledger.h"
#include "pipeline/stage_names.h"
#include "pipeline/stage_options.h"

namespace cairn {
namespace {

std::string VerificationStageOptions(const BuildPipelineOptions& options) {
  return "verifier = \"" + options.inputs.verifier +
         "\"\nseed = " + std::to_string(options.inputs.seed) + "\n" +
         DumpQualified("verification", options.verification);
}

int StageIndex(const std::string& stage) {
  const std::vector<std::string> stages = {kStageCameras, kStageFeatures, kStageDepth,
                                           kStageMatching, kStageVerification};
  for (size_t i = 0; i < stages.size(); ++i) {
    if (stages[i] == stage) return static_cast<int>(i);
  }
  throw ConfigError("stop_after", "'" + stage + "' is no stage");
}

// Options that differ from those of rows that are there are an error at once, not after an hour.
void CheckStageOptions(Database& database, const BuildPipelineOptions& options) {
  const int last = StageIndex(options.inputs.stop_after);
  StageLedger(database, kStageCameras, DumpOptions(options.cameras));
  StageLedger(database, kStageFeatures, DumpQualified("features", options.features));
  const DepthSource source = {options.inputs.depth_path, options.inputs.depth_model};
  if (last >= StageIndex(kStageDepth) && source.depth_path.size() + source.depth_model.size() > 0) {
    StageLedger(database, kStageDepth, DepthStageOptions(source, options.depth));
  }
  if (last >= StageIndex(kStageMatching)) {
    StageLedger(database, kStageMatching, DumpQualified("matching", options.matching));
  }
  if (last >= StageIndex(kStageVerification)) {
    StageLedger(database, kStageVerification, VerificationStageOptions(options));
  }
}

Database OpenDatabase(const BuildInputs& inputs) {
  // Without images there is nothing to begin with, so the database must be there.
  const bool may_create = !inputs.image_path.empty();
  return Database(inputs.database_path,
                  may_create ? Database::Mode::kCreateOrOpen : Database::Mode::kOpenExisting);
}

// Runs the stages one after the other; false: the user stopped one.
bool RunStages(Database& database, const BuildPipelineOptions& options, ProgressMonitor& monitor,
               RunReport& run) {
  const BuildInputs& in = options.inputs;
  const int last = StageIndex(in.stop_after);
  const auto keep_going = [&run](StageReport stage) {
    run.stages.push_back(std::move(stage));
    return !StoppedEarly(run.stages.back());
  };
  if (!keep_going(
          ImportPhotos(database, in.image_path, options.cameras, in.num_threads, monitor)) ||
      !keep_going(ExtractImageFeatures(database, in.image_path, options.features, in.num_threads,
                                       monitor))) {
    return false;
  }
  if (last >= StageIndex(kStageDepth) &&
      !keep_going(SampleImageDepth(database, in.image_path, {in.depth_path, in.depth_model},
                                   options.depth, in.num_threads, monitor))) {
    return false;
  }
  std::optional<std::vector<image_pair_t>> pairs;
  if (!in.pairs_path.empty()) pairs = ReadPairList(in.pairs_path, database.ReadImages(), monitor);
  if (last >= StageIndex(kStageMatching) &&
      !keep_going(MatchImagePairs(database, pairs, options.matching, options.scheduler,
                                  in.num_threads, monitor))) {
    return false;
  }
  if (last < StageIndex(kStageVerification)) return true;
  VerificationInput input;
  input.pairs = pairs;
  input.seed = static_cast<uint64_t>(in.seed);
  input.min_num_matches = options.verification.min_num_matches;
  input.options = VerificationStageOptions(options);
  return keep_going(VerifyPairs(database, MakeVerifiers(in.verifier, options.verification), input,
                                options.scheduler, in.num_threads, monitor)
                        .stage);
}

std::string Failure(const BuildInputs& inputs, const ViewGraphSummary& summary) {
  if (summary.num_images_with_features == 0) {
    return "features: no image has features; look at the warnings above";
  }
  if (inputs.stop_after == kStageVerification && summary.num_verified == 0) {
    return "verification: of " + std::to_string(summary.num_pairs) +
           " pairs none was verified; do the photographs overlap, and are the cameras right?";
  }
  return "";
}

void CountComponents(const std::vector<std::pair<image_pair_t, int>>& pairs,
                     const std::vector<Image>& images, ViewGraphSummary& summary) {
  std::map<image_t, int> nodes;
  for (const Image& image : images) nodes.emplace(image.image_id, static_cast<int>(nodes.size()));
  std::vector<GraphEdge> edges;
  for (const auto& [pair, num_inliers] : pairs) {
    const auto [id1, id2] = PairIdToImagePair(pair);
    if (num_inliers > 0 && nodes.count(id1) > 0 && nodes.count(id2) > 0) {
      edges.push_back({nodes[id1], nodes[id2]});
    }
  }
  for (const auto& component : ConnectedComponents(static_cast<int>(nodes.size()), edges).nodes) {
    if (component.size() < 2) continue;
    ++summary.num_components;
    summary.largest_component =
        std::max(summary.largest_component, static_cast<int>(component.size()));
  }
}

// "12 (a 10, b 2)".
std::string WithParts(int64_t total, const std::map<std::string, int64_t>& parts) {
  std::string text = std::to_string(total);
  std::string list;
  for (const auto& [name, count] : parts) {
    list += (list.empty() ? "" : ", ") + name + " " + std::to_string(count);
  }
  return list.empty() ? text : text + " (" + list + ")";
}

}  // namespace

ViewGraphSummary SummarizeDatabase(const Database& database) {
  ViewGraphSummary summary;
  const std::vector<Image> images = database.ReadImages();
  summary.num_images = static_cast<int>(images.size());
  summary.num_images_with_features = static_cast<int>(database.ReadNumKeypoints().size());
  summary.num_images_with_depth = static_cast<int>(database.ReadNumDepthSamples().size());
  for (const PhotoRecord& photo : database.ReadPhotos()) {
    summary.num_skipped_photos += !photo.error.empty();
  }
  summary.num_pairs = static_cast<int64_t>(database.ReadNumMatches().size());
  const auto num_inliers = database.ReadNumInliers();
  for (const auto& [pair, num] : num_inliers) summary.num_verified += num > 0;
  summary.verified_by = database.CountWinners();
  int64_t num_ours = 0;
  for (const auto& [verifier, num] : summary.verified_by) num_ours += num;
  summary.num_verified = std::max(summary.num_verified, num_ours);  // Imported ones lack inliers.
  if (summary.num_verified > num_ours) {
    summary.verified_by["given"] = summary.num_verified - num_ours;
  }
  summary.num_tried = num_ours;
  for (const auto& [reason, num] : database.CountJobNotes(kStageVerification)) {
    if (reason.empty()) continue;
    if (reason == PairStatusName(PairStatus::kTooFewMatches)) {
      summary.num_too_few = num;
    } else {
      summary.rejected_by[reason] = num;
      summary.num_tried += num;
    }
  }
  CountComponents(num_inliers, images, summary);
  return summary;
}

std::string SummaryText(const ViewGraphSummary& s, const RunReport& report) {
  int64_t num_rejected = 0;
  for (const auto& [reason, num] : s.rejected_by) num_rejected += num;
  std::string text;
  text += "images    " + std::to_string(s.num_images) + " (" +
          std::to_string(s.num_images_with_features) + " with features, " +
          std::to_string(s.num_images_with_depth) + " with depth), " +
          std::to_string(s.num_skipped_photos) + " photographs skipped\n";
  text += "pairs     " + std::to_string(s.num_pairs) + ", " + std::to_string(s.num_too_few) +
          " with too few matches, " + std::to_string(s.num_tried) + " tried\n";
  text += "verified  " + WithParts(s.num_verified, s.verified_by) + "\n";
  text += "rejected  " + WithParts(num_rejected, s.rejected_by) + "\n";
  text += "graph     " + std::to_string(s.num_components) + " component" +
          (s.num_components == 1 ? "" : "s") + ", the largest with " +
          std::to_string(s.largest_component) + " images\n";
  text += "seconds  ";
  for (const StageReport& stage : report.stages) {
    char item[80];
    std::snprintf(item, sizeof(item), " %s %.2f", stage.name.c_str(), stage.seconds);
    text += item;
  }
  return text + "\n";
}

BuildPipelineReport RunBuildPipeline(const BuildPipelineOptions& options,
                                     ProgressMonitor& monitor) {
  const BuildInputs& inputs = options.inputs;
  BuildPipelineReport report;
  report.run.program = "build_view_graph";
  report.run.seed = static_cast<uint64_t>(inputs.seed);
  report.run.num_threads = inputs.num_threads;
  Database database = OpenDatabase(inputs);
  PrepareRecompute(database, inputs.recompute, inputs.image_path);
  CheckStageOptions(database, options);
  report.was_stopped = !RunStages(database, options, monitor, report.run);
  report.summary = SummarizeDatabase(database);
  report.run.failure = report.was_stopped ? report.run.stages.back().name + ": " +
                                                report.run.stages.back().messages.back()
                                          : Failure(inputs, report.summary);
  return report;
}

}  // namespace cairn
