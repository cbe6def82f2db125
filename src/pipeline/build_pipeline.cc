#include "cairn/pipeline/build_pipeline.h"

#include <filesystem>

#include "cairn/base/error.h"
#include "cairn/database/report_bad_rows.h"
#include "cairn/database/stage_names.h"
#include "cairn/intrinsics/wide_focals.h"
#include "pipeline/stages/import_dataset.h"
#include "pipeline/stages/recompute.h"
#include "pipeline/stages/stage_ledger.h"
#include "pipeline/stages/stage_options.h"

namespace cairn {
namespace {

std::string VerificationStageOptions(const BuildPipelineOptions& options, uint64_t seed) {
  return "verifier = \"" + std::string(NameOf(kVerifierChoices, options.inputs.verifier)) +
         "\"\nseed = " + std::to_string(seed) + "\n" +
         DumpQualified("verification", options.verification);
}

// Options that differ from those of rows that are there are an error at once, not after an hour.
void CheckStageOptions(Database& database, const BuildPipelineOptions& options, uint64_t seed) {
  const BuildStage last = options.inputs.stop_after;
  StageLedger(database, kStageCameras, DumpOptions(options.cameras));
  StageLedger(database, kStageFeatures, DumpQualified("features", options.features));
  const DepthSource source = {options.inputs.depth_path, options.inputs.depth_model};
  if (last >= BuildStage::kDepth && source.depth_path.size() + source.depth_model.size() > 0) {
    StageLedger(database, kStageDepth, DepthStageOptions(source, options.depth));
  }
  if (last >= BuildStage::kMatching) {
    StageLedger(database, kStageMatching, DumpQualified("matching", options.matching));
  }
  if (last >= BuildStage::kVerification) {
    StageLedger(database, kStageVerification, VerificationStageOptions(options, seed));
  }
}

// Without images there is nothing to begin with, so the database must be there.
Database OpenDatabase(const BuildInputs& inputs) {
  const bool may_create = !inputs.image_path.empty() || !inputs.dataset_path.empty();
  return Database(inputs.database_path,
                  may_create ? Database::Mode::kCreateOrOpen : Database::Mode::kOpenExisting);
}

// The photographs and pairs of a run: those of the folder and the pair list, or of a data set.
struct Sources {
  std::string image_path;
  std::optional<OneDsfmDataset> dataset;
};

Sources FindSources(const BuildInputs& inputs) {
  Sources sources;
  sources.image_path = inputs.image_path;
  if (inputs.dataset_path.empty()) return sources;
  if (!inputs.image_path.empty() || !inputs.pairs_path.empty()) {
    throw ConfigError("dataset_path",
                      "brings its own photographs and pairs; image_path and "
                      "pairs_path cannot be given too");
  }
  sources.dataset = ReadOneDsfmDataset(inputs.dataset_path);
  if (sources.dataset->has_photographs) sources.image_path = inputs.dataset_path + "/images";
  return sources;
}

std::optional<std::vector<image_pair_t>> FindPairs(const Database& database,
                                                   const BuildInputs& inputs,
                                                   const Sources& sources,
                                                   ProgressMonitor& monitor) {
  if (sources.dataset) return FindDatasetPairs(*sources.dataset, database.ReadImages());
  if (inputs.pairs_path.empty()) return std::nullopt;
  return ReadPairList(inputs.pairs_path, database.ReadImages(), monitor);
}

// Runs the stages one after the other; false: the user stopped one.
bool RunStages(Database& database, const BuildPipelineOptions& options, const Sources& sources,
               const RunContext& run, RunReport& report) {
  const BuildInputs& in = options.inputs;
  const BuildStage last = in.stop_after;
  const auto keep_going = [&report](StageReport stage) {
    report.stages.push_back(std::move(stage));
    return !report.stages.back().WasStopped();
  };
  if (sources.dataset && !sources.dataset->has_photographs) {
    return keep_going(ImportDataset(database, *sources.dataset, options.cameras, run));
  }
  PhotoSource photos = {sources.image_path};
  if (sources.dataset) photos.selection = SelectDatasetPhotos(*sources.dataset);
  if (!keep_going(ImportPhotos(database, photos, options.cameras, run)) ||
      !keep_going(ExtractImageFeatures(database, sources.image_path, options.features, run))) {
    return false;
  }
  if (last >= BuildStage::kDepth &&
      !keep_going(SampleImageDepth(database, sources.image_path, {in.depth_path, in.depth_model},
                                   options.depth, run))) {
    return false;
  }
  if (last < BuildStage::kMatching) return true;
  const auto pairs = FindPairs(database, in, sources, run.monitor);
  if (!keep_going(MatchImagePairs(database, pairs, options.matching, options.scheduler, run))) {
    return false;
  }
  if (last < BuildStage::kVerification) return true;
  VerificationInput input;
  input.pairs = pairs;
  input.min_num_matches = options.verification.min_num_matches;
  input.options = VerificationStageOptions(options, run.seed);
  for (const std::string& text : LearnWideFocals(database, options.verification, run)) {
    run.monitor.Info(text);
  }
  return keep_going(VerifyPairs(database,
                                MakeVerifiers(std::string(NameOf(kVerifierChoices, in.verifier)),
                                              options.verification),
                                input, options.scheduler, run)
                        .stage);
}

std::string Failure(const BuildInputs& inputs, const ViewGraphSummary& summary) {
  if (summary.num_verified > 0) return "";
  if (summary.num_images_with_features == 0) {
    return "features: no image has features; look at the warnings above";
  }
  if (summary.num_images < 2) {
    return "matching: there is one photograph alone, and no pair; give two or more of one scene";
  }
  if (inputs.stop_after == BuildStage::kVerification) {
    return "verification: of " + std::to_string(summary.num_pairs) +
           " pairs none was verified; do the photographs overlap, and are the cameras right?";
  }
  return "";
}

}  // namespace

std::vector<std::string> StoredOptions(const BuildInputs& inputs) {
  std::vector<std::string> options;
  if (!std::filesystem::exists(inputs.database_path)) return options;
  std::optional<Database> database;
  try {
    database.emplace(inputs.database_path, Database::Mode::kReadOnly);
  } catch (const IoError&) {
    // Empty, since it was interrupted when it was made; or else RunBuildPipeline says what it is.
    return options;
  }
  const std::string recompute(NameOf(kBuildStages, inputs.recompute));
  for (const std::string& stage :
       {kStageCameras, kStageFeatures, kStageDepth, kStageMatching, kStageVerification}) {
    const std::optional<StageRecord> record = database->ReadStage(stage);
    if (record && !ForgetsStage(recompute, stage)) options.push_back(record->options);
  }
  return options;
}

BuildPipelineReport RunBuildPipeline(const BuildPipelineOptions& options, const RunContext& run) {
  const BuildInputs& inputs = options.inputs;
  ValidateOptions(inputs, "");
  BuildPipelineOptions(options).VisitModules(
      [](const char* module, auto& fields) { ValidateOptions(fields, module); });
  BuildPipelineReport report;
  report.run.program = "build_view_graph";
  report.run.seed = run.seed;
  report.run.num_threads = run.num_threads;
  const Sources sources = FindSources(inputs);
  Database database = OpenDatabase(inputs);
  ReportBadRows(database, report.run, run.monitor);
  PrepareRecompute(database, std::string(NameOf(kBuildStages, inputs.recompute)),
                   sources.image_path);
  CheckStageOptions(database, options, run.seed);
  report.was_stopped = !RunStages(database, options, sources, run, report.run);
  report.summary = SummarizeDatabase(database);
  report.run.values = SummaryValues(report.summary);
  report.run.failure = report.was_stopped ? report.run.stages.back().name + ": " +
                                                report.run.stages.back().messages.back()
                                          : Failure(inputs, report.summary);
  return report;
}

}  // namespace cairn
