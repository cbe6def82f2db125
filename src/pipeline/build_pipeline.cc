#include "cairn/pipeline/build_pipeline.h"

#include <algorithm>
#include <filesystem>

#include "base/file_lock.h"
#include "base/memory.h"
#include "cairn/base/error.h"
#include "cairn/database/report_bad_rows.h"
#include "cairn/image/image_folder.h"
#include "database/stage_names.h"
#include "intrinsics/shared_lenses.h"
#include "intrinsics/wide_focals.h"
#include "pipeline/machines/helpers.h"
#include "pipeline/pairs/choose.h"
#include "pipeline/stages/depth_source.h"
#include "pipeline/stages/fisheye_lenses.h"
#include "pipeline/stages/foreign_features.h"
#include "pipeline/stages/import_dataset.h"
#include "pipeline/stages/masks.h"
#include "pipeline/stages/recompute.h"
#include "pipeline/stages/stage_ledger.h"

namespace cairn {
namespace {

// Of all pairs with matches.
VerificationInput InputOfVerification(const BuildPipelineOptions& options, uint64_t seed) {
  VerificationInput input;
  input.min_num_matches = options.verification.min_num_matches;
  input.options = "verifier = \"" + std::string(NameOf(kVerifierChoices, options.inputs.verifier)) +
                  "\"\nseed = " + std::to_string(seed) + "\n" +
                  DumpQualified("verification", options.verification);
  input.scheduler = options.scheduler;
  return input;
}

DepthSource DepthOf(const BuildInputs& inputs) { return {inputs.depth_path, inputs.depth_model}; }

bool HasDepth(const BuildInputs& inputs) {
  return !inputs.depth_path.empty() || !inputs.depth_model.empty();
}

// Options that differ from those of rows that are there are an error at once, not after an hour.
void CheckAllOptions(const Database& database, const BuildPipelineOptions& options, uint64_t seed) {
  const BuildStage last = options.inputs.stop_after;
  CheckStageOptions(database, kStageCameras, DumpOptions(options.cameras));
  CheckStageOptions(database, kStageFeatures, DumpQualified("features", options.features));
  if (last >= BuildStage::kDepth && HasDepth(options.inputs)) {
    CheckStageOptions(database, kStageDepth,
                      DepthStageOptions(DepthOf(options.inputs), options.depth));
    CheckDepthIsInTime(database, DepthOf(options.inputs));
  }
  if (last >= BuildStage::kMatching) {
    CheckStageOptions(database, kStageMatching, DumpQualified("matching", options.matching));
  }
  if (last >= BuildStage::kVerification) {
    CheckStageOptions(database, kStageVerification, InputOfVerification(options, seed).options);
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
  const bool has_pairs = inputs.pairs != BuildInputs().pairs;
  if (!inputs.pairs_path.empty() && has_pairs) {
    throw ConfigError("pairs_path", "names the pairs itself; --pairs cannot be given too");
  }
  if (inputs.dataset_path.empty()) return sources;
  if (!inputs.image_path.empty() || !inputs.pairs_path.empty() || has_pairs) {
    throw ConfigError("dataset_path",
                      "brings its own photographs and pairs; --image_path, --pairs_path and "
                      "--pairs cannot be given too");
  }
  sources.dataset = ReadOneDsfmDataset(inputs.dataset_path);
  if (sources.dataset->has_photographs) sources.image_path = inputs.dataset_path + "/images";
  return sources;
}

// Before features are computed for hours.
void CheckSources(const BuildPipelineOptions& options, const Sources& sources) {
  const BuildInputs& inputs = options.inputs;
  if (!sources.image_path.empty()) CheckImageFolder(sources.image_path);
  if (sources.dataset && sources.image_path.empty()) {
    for (const auto& [option, path] :
         {std::pair("depth_path", &inputs.depth_path),
          std::pair("depth_model", &inputs.depth_model), std::pair("mask_path", &inputs.mask_path),
          std::pair("gps_path", &inputs.gps_path)}) {
      if (!path->empty()) throw ConfigError(option, "the data set has no photographs");
    }
  }
  CheckDepthSource(sources.image_path, DepthOf(inputs), options.depth);
  if (inputs.recompute == BuildStage::kDepth && !HasDepth(inputs)) {
    throw ConfigError("recompute", "depth needs --depth_path or --depth_model");
  }
  if (!inputs.mask_path.empty() && sources.image_path.empty()) {
    throw ConfigError("mask_path", "needs --image_path");
  }
  if (!inputs.mask_path.empty() && !std::filesystem::is_directory(inputs.mask_path)) {
    throw IoError(inputs.mask_path, "no such folder");
  }
}

// Pairs that the user or the data set names, if they do.
std::optional<std::vector<image_pair_t>> ListedPairs(const Database& database,
                                                     const BuildInputs& inputs,
                                                     const Sources& sources,
                                                     ProgressMonitor& monitor) {
  if (sources.dataset) return FindDatasetPairs(*sources.dataset, database.ReadImages());
  if (inputs.pairs_path.empty()) return std::nullopt;
  return ReadPairList(inputs.pairs_path, database.ReadImages(), monitor);
}

// What earlier runs had beside the photographs.
struct EarlierSources {
  bool has_masks = false;
  bool has_depth = false;
  bool has_list = false;  // of pairs
};

EarlierSources FindEarlierSources(const Database& database) {
  return {HasMasks(database), database.ReadStage(kStageDepth).has_value(),
          database.ReadStage(kStageMatching) && !database.ReadStage(kStagePairs)};
}

// A list of pairs is not stored, as other options are: it may grow, and so may its file move.
void NoteOtherPairs(const Database& database, const EarlierSources& earlier, bool has_list,
                    ProgressMonitor& monitor) {
  if (has_list && database.ReadStage(kStagePairs)) {
    monitor.Warning(
        "pairs that earlier runs chose stay beside those of the list; --recompute "
        "pairs removes them");
  }
  if (!has_list && earlier.has_list) {
    monitor.Warning(
        "earlier runs took the pairs of a list; this one has none, and chooses pairs "
        "by --pairs. Give --pairs_path again to add no others");
  }
}

void NoteUnusedPositions(const BuildInputs& inputs, bool has_list, ProgressMonitor& monitor) {
  const bool may_use = inputs.pairs == "auto" || inputs.pairs.find("spatial") != std::string::npos;
  if (inputs.gps_path.empty() || (may_use && !has_list)) return;
  monitor.Warning("--gps_path is not used: it serves --pairs spatial and auto alone");
}

// Folders are not stored, as options are: they may move. Those that are left out may be forgotten.
void NoteOtherSources(const Database& database, const EarlierSources& earlier,
                      const BuildInputs& inputs, ProgressMonitor& monitor) {
  const size_t num_images = database.ReadImages().size();
  if (earlier.has_masks && inputs.mask_path.empty() &&
      database.ReadNumKeypoints().size() < num_images) {
    monitor.Warning(
        "earlier runs left out parts of photographs by masks; this one has none, and finds "
        "features everywhere. Give --mask_path again to leave them out");
  }
  if (earlier.has_depth && inputs.stop_after >= BuildStage::kDepth && !HasDepth(inputs) &&
      database.ReadJobs(kStageDepth).size() < num_images) {
    monitor.Warning(
        "earlier runs had depth; this one has none, so photographs whose features it finds get "
        "none. Give --depth_path or --depth_model again");
  }
}

// The stages of a run, which end early where the user stops it.
class BuildRun {
 public:
  BuildRun(Database& database, const BuildPipelineOptions& options, const RunContext& run,
           Helpers* helpers, RunReport& report)
      : database_(database), options_(options), run_(run), helpers_(helpers), report_(report) {}

  // Runs the stages one after the other; false: the user stopped one. What --recompute and
  // --drop_missing take out is gone only once nothing more can be wrong with the command.
  bool Run(const Sources& sources) {
    const BuildInputs& in = options_.inputs;
    const BuildStage last = in.stop_after;
    const EarlierSources earlier = FindEarlierSources(database_);
    Database::Transaction transaction(database_);
    PrepareRecompute(database_, in.recompute, sources.image_path, DepthOf(in));
    CheckAllOptions(database_, options_, run_.seed);
    if (sources.dataset && !sources.dataset->has_photographs) {
      transaction.Commit();
      return KeepGoing(ImportDataset(database_, *sources.dataset, options_.cameras, run_));
    }
    PhotoSource photos = {.image_path = sources.image_path,
                          .other_paths = {in.mask_path, in.depth_path},
                          .drop_missing = in.drop_missing,
                          .recompute_changed = in.recompute == BuildStage::kChanged};
    if (sources.dataset) photos.selection = SelectDatasetPhotos(*sources.dataset);
    if (!KeepGoing(ImportPhotos(database_, photos, options_.cameras, run_))) return false;
    CheckPositions(in.gps_path, database_.ReadImages(), run_.monitor);
    const PairChoosing choosing = {in.pairs, options_.pair_selection, sources.image_path,
                                   in.gps_path};
    const auto listed = ListedPairs(database_, in, sources, run_.monitor);
    NoteUnusedPositions(in, listed.has_value(), run_.monitor);
    if (last >= BuildStage::kMatching)
      NoteOtherPairs(database_, earlier, listed.has_value(), run_.monitor);
    if (!listed && last >= BuildStage::kPairs) CheckPairWays(database_, choosing, run_);
    CheckMasks(database_, in.mask_path);
    if (last >= BuildStage::kDepth) CheckDepthMaps(database_, in.depth_path);
    transaction.Commit();
    NoteOtherSources(database_, earlier, in, run_.monitor);
    if (!KeepGoing(ExtractImageFeatures(database_, {sources.image_path, in.mask_path},
                                        options_.features, run_, helpers_))) {
      return false;
    }
    if (last >= BuildStage::kDepth &&
        !KeepGoing(
            SampleImageDepth(database_, sources.image_path, DepthOf(in), options_.depth, run_))) {
      return false;
    }
    if (last < BuildStage::kPairs) return true;
    if (listed && last < BuildStage::kMatching) return true;
    return listed ? MatchAndVerify(*listed, listed) : RunRounds(choosing);
  }

 private:
  // Adds a stage to the report; false: the user stopped it.
  bool KeepGoing(StageReport stage) {
    for (ResultWarning& warning : stage.warnings) {
      // Rounds of pairs repeat what is wrong with the database.
      std::erase_if(report_.warnings,
                    [&](const ResultWarning& earlier) { return earlier.what == warning.what; });
      report_.warnings.push_back(std::move(warning));
    }
    report_.stages.push_back(std::move(stage));
    return !report_.stages.back().WasStopped();
  }

  // Matches the given pairs; verifies these and all that we matched, or (nullopt) all that have
  // matches.
  bool MatchAndVerify(const std::vector<image_pair_t>& pairs,
                      const std::optional<std::vector<image_pair_t>>& to_verify) {
    if (!KeepGoing(MatchImagePairs(database_, {pairs, options_.scheduler}, options_.matching, run_,
                                   helpers_))) {
      return false;
    }
    const BuildInputs& in = options_.inputs;
    if (in.stop_after < BuildStage::kVerification) return true;
    VerificationInput input = InputOfVerification(options_, run_.seed);
    input.pairs = to_verify;
    if (!Verify(input)) return false;
    StageReport fisheyes = TakeFisheyes(database_, options_.verification, run_);
    if (fisheyes.Value("cameras") == 0) return true;
    return KeepGoing(std::move(fisheyes)) && Verify(input);
  }

  bool Verify(const VerificationInput& input) {
    AdoptLenses(database_);
    for (const std::string& text : LearnWideFocals(database_, options_.verification, run_)) {
      run_.monitor.Info(text);
    }
    const std::vector<NamedVerifier> verifiers = MakeVerifiers(
        std::string(NameOf(kVerifierChoices, options_.inputs.verifier)), options_.verification);
    return KeepGoing(VerifyPairs(database_, verifiers, input, run_, helpers_));
  }

  // Chooses, matches and verifies pairs, round by round.
  bool RunRounds(const PairChoosing& choosing) {
    const BuildStage last = options_.inputs.stop_after;
    PairChooser chooser(database_, choosing, run_);
    if (!KeepGoing(chooser.ChooseFirst())) return false;
    if (last < BuildStage::kMatching) return true;
    std::vector<image_pair_t> pairs = chooser.Chosen();
    do {
      if (!MatchAndVerify(pairs, std::nullopt)) return false;
      if (last < BuildStage::kVerification) return true;
      pairs = chooser.ChooseNext();
    } while (!pairs.empty());
    if (!run_.monitor.StopRequested()) return true;
    report_.stages.back().MarkStopped();
    return false;
  }

  Database& database_;
  const BuildPipelineOptions& options_;
  const RunContext& run_;
  Helpers* const helpers_;
  RunReport& report_;
};

std::optional<Helpers> FindHelpers(const BuildPipelineOptions& options, const RunContext& run,
                                   Peers* peers) {
  if (peers == nullptr || peers->size() == 1) return std::nullopt;
  HelperSetup setup = {run.seed,
                       run.num_threads,
                       std::string(NameOf(kVerifierChoices, options.inputs.verifier)),
                       options.features,
                       options.matching,
                       options.verification,
                       /*num_on_machine=*/1};
  // As much as a tile has (MatchAll), so that an image travels once a tile.
  return Helpers(*peers, setup, GibToBytes(options.scheduler.max_memory_gib) / 2, run);
}

// What another program took out of the database is computed again.
void ForgetLostRows(Database& database, const Sources& sources, ProgressMonitor& monitor) {
  const Database::LostRows lost = database.ForgetLostRows(!sources.image_path.empty());
  if (lost.num_images + lost.num_pairs == 0) return;
  monitor.Info("computed again, since another program deleted their rows: " +
               std::to_string(lost.num_images) + " images, " + std::to_string(lost.num_pairs) +
               " pairs");
}

std::string Failure(const BuildInputs& inputs, const ViewGraphSummary& summary) {
  if (summary.num_verified > 0) return "";
  if (summary.num_images_with_features == 0) {
    return "features: no image has features; look at the warnings above";
  }
  if (inputs.stop_after >= BuildStage::kPairs && summary.num_images < 2) {
    return "matching: there is one photograph alone, and no pair; give two or more of one scene";
  }
  if (inputs.stop_after == BuildStage::kVerification) {
    return "verification: of " + std::to_string(summary.num_pairs) +
           " pairs none was verified; do the photographs overlap, and are the cameras right?";
  }
  return "";
}

// Those that decide what a stage computes. A database from elsewhere does not name files, and asks
// for nothing to be computed again or dropped.
std::string OptionsOfStage(const StageRecord& record) {
  const auto inputs = StageRecord{"", DumpOptions(BuildInputs())}.OptionValues();
  std::string options;
  for (const auto& [key, value] : record.OptionValues()) {
    const bool is_plain =
        key.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789_.") == std::string::npos;
    const bool is_input = inputs.contains(key) && key != "pairs" && key != "verifier";
    if (is_plain && !is_input) options += key + " = " + value + "\n";
  }
  return options;
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
  // A list of pairs comes instead of the way that they were chosen by.
  const bool has_list = !inputs.pairs_path.empty() || !inputs.dataset_path.empty();
  for (const std::string& stage : {kStageDataset, kStageCameras, kStageFeatures, kStageDepth,
                                   kStagePairs, kStageMatching, kStageVerification}) {
    const std::optional<StageRecord> record = database->ReadStage(stage);
    if (stage == kStagePairs && has_list) continue;
    if (record) options.push_back(OptionsOfStage(*record));
  }
  // So that new photographs match those that another program has found features in.
  if (inputs.recompute != BuildStage::kFeatures && !database->ReadStage(kStageFeatures) &&
      HasForeignSift(*database)) {
    options.push_back("features.type = \"sift\"\n");
  }
  return options;
}

BuildPipelineReport RunBuildPipeline(const BuildPipelineOptions& options, const RunContext& run,
                                     Peers* peers) {
  const BuildInputs& inputs = options.inputs;
  ValidateOptions(inputs, "");
  BuildPipelineOptions(options).VisitModules(
      [](const char* module, auto& fields) { ValidateOptions(fields, module); });
  ParsePairWays(inputs.pairs);
  if (inputs.drop_missing && inputs.image_path.empty()) {
    throw ConfigError("drop_missing", "needs --image_path, the folder that may lack photographs");
  }
  BuildPipelineReport report;
  report.run.program = "build_view_graph";
  report.run.seed = run.seed;
  report.run.num_threads = run.num_threads;
  const Sources sources = FindSources(inputs);
  CheckSources(options, sources);
  const FileLock lock(inputs.database_path);
  Database database = OpenDatabase(inputs);
  ForgetLostRows(database, sources, run.monitor);
  ReportBadRows(database, report.run, run.monitor);
  std::optional<Helpers> helpers = FindHelpers(options, run, peers);
  BuildRun build(database, options, run, helpers ? &*helpers : nullptr, report.run);
  report.was_stopped = !build.Run(sources);
  report.summary = SummarizeDatabase(database);
  report.run.values = SummaryValues(report.summary);
  report.run.failure = report.was_stopped ? report.run.stages.back().name + ": " +
                                                report.run.stages.back().messages.back()
                                          : Failure(inputs, report.summary);
  return report;
}

}  // namespace cairn
