#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "cairn/base/peers.h"
#include "cairn/depth/options.h"
#include "cairn/features/features.h"
#include "cairn/matching/matching.h"
#include "cairn/pair_selection/options.h"
#include "cairn/pipeline/stages.h"
#include "cairn/report/run_report.h"
#include "cairn/two_view/options.h"

namespace cairn {

// Which verifiers are run on every pair.
enum class VerifierChoice { kCascade, kFast, kOneAcDepth, kTwoAc, kFivePoint, kBoth };
inline constexpr NamedValue<VerifierChoice> kVerifierChoices[] = {
    {VerifierChoice::kCascade, "cascade"},
    {VerifierChoice::kFast, "fast"},
    {VerifierChoice::kOneAcDepth, "one_ac_depth"},
    {VerifierChoice::kTwoAc, "two_ac"},
    {VerifierChoice::kFivePoint, "five_point"},
    {VerifierChoice::kBoth, "both"}};  // one_ac_depth and five_point

// The stages, in order, by the names that they have in the database; before them what --recompute
// takes beside stages (changed: photographs).
enum class BuildStage {
  kNone,
  kChanged,
  kCameras,
  kFeatures,
  kDepth,
  kPairs,
  kMatching,
  kVerification
};
inline constexpr NamedValue<BuildStage> kBuildStages[] = {
    {BuildStage::kNone, "none"},         {BuildStage::kChanged, "changed"},
    {BuildStage::kCameras, "cameras"},   {BuildStage::kFeatures, "features"},
    {BuildStage::kDepth, "depth"},       {BuildStage::kPairs, "pairs"},
    {BuildStage::kMatching, "matching"}, {BuildStage::kVerification, "verification"}};

// What build_view_graph works on; the options of the modules follow in BuildPipelineOptions.
struct BuildInputs {
  std::string image_path;
  std::string database_path;
  std::string dataset_path;
  std::string mask_path;
  std::string depth_path;
  std::string depth_model;
  std::string pairs = "auto";
  std::string pairs_path;
  std::string gps_path;
  VerifierChoice verifier = VerifierChoice::kCascade;
  BuildStage stop_after = BuildStage::kVerification;
  BuildStage recompute = BuildStage::kNone;
  bool drop_missing = false;

  void VisitFields(OptionVisitor& v) {
    v.String("image_path", image_path, "folder of photographs");
    v.String("database_path", database_path, "database to make, or to continue (required)");
    v.String("dataset_path", dataset_path, "folder of a 1DSfM data set, instead of image_path");
    v.String("mask_path", mask_path,
             "folder of masks, <image name>.png (a.jpg.png): no features where they are black");
    v.String("depth_path", depth_path,
             "folder of depth maps, <image name>.npy, .pfm, .png or .bin");
    v.String("depth_model", depth_model, "ONNX network that gives depth, instead of depth_path");
    v.String("pairs", pairs,
             "which pairs are matched: exhaustive, or one or more of sequential,spatial,retrieval; "
             "auto: exhaustive up to a minute of two cores, then retrieval with what names, times "
             "and GPS add");
    v.String("pairs_path", pairs_path, "file with two image names a line, instead of pairs");
    v.String("gps_path", gps_path,
             "file with name,latitude,longitude[,altitude[,sigma]] a line, instead of GPS in EXIF");
    v.Choice("verifier", verifier, kVerifierChoices, "which verifiers are run on every pair");
    v.Choice("stop_after", stop_after, std::span(kBuildStages).subspan(3),
             "last stage of this run; a later run continues");
    v.Choice("recompute", recompute, kBuildStages,
             "stage to compute again, with those that depend on it, or photographs that changed; "
             "options that are not given stay as they were");
    v.Bool("drop_missing", drop_missing,
           "photographs that image_path no longer has leave the database, with their pairs");
  }
};

struct BuildPipelineOptions {
  BuildInputs inputs;
  CameraOptions cameras;
  FeatureOptions features;
  DepthOptions depth;
  PairSelectionOptions pair_selection;
  MatchingOptions matching;
  TwoViewOptions verification;
  SchedulerOptions scheduler;

  // Calls visit(module, options) for each module's options, in order: for flags and validation.
  template <class Visit>
  void VisitModules(const Visit& visit) {
    visit("", cameras);
    visit("features", features);
    visit("depth", depth);
    visit("pair_selection", pair_selection);
    visit("matching", matching);
    visit("verification", verification);
    visit("scheduler", scheduler);
  }
};

// The options, as TOML text, of the stages that are in the database already: options that are not
// given again stay as they were, those of stages that are computed again, too. Where features are
// another program's SIFT, features.type is sift.
std::vector<std::string> StoredOptions(const BuildInputs& inputs);

// What the database has after a run, whoever computed it.
struct ViewGraphSummary {
  int num_images = 0;
  int num_images_with_features = 0;
  int num_images_with_depth = 0;
  int num_skipped_photos = 0;
  int64_t num_pairs = 0;                        // with a row in matches; if none, the chosen ones
  int64_t num_tried = 0;                        // by us
  int64_t num_too_few = 0;                      // not tried: too few matches
  int64_t num_verified = 0;                     // with inliers, or with an imported pose
  std::map<std::string, int64_t> verified_by;   // verifier -> pairs; "given": by another program
  std::map<std::string, int64_t> rejected_by;   // reason -> pairs
  std::vector<Database::StepTimes> decided_by;  // steps of our verifiers
  int num_components = 0;                       // of the graph of verified pairs, with >= 2 images
  int largest_component = 0;                    // images in it
};
ViewGraphSummary SummarizeDatabase(const Database& database);
// The same as names and numbers, for the run's report.
std::vector<std::pair<std::string, double>> SummaryValues(const ViewGraphSummary& summary);
// A few lines for the terminal; the report gives times and warnings of a run.
std::string SummaryText(const ViewGraphSummary& summary, const RunReport& report);

struct BuildPipelineReport {
  RunReport run;
  ViewGraphSummary summary;
  bool was_stopped = false;  // the monitor wanted to stop; the database is ready to continue
};

// The whole of build_view_graph: photographs and cameras, features, depth, matches, verified pairs,
// all in the database, which may have some of it already. Throws ConfigError for options that are
// out of range or contradict each other or the database, IoError when the run cannot go on. Where
// there is no usable result (nothing verified, or no features with stop_after features),
// report.run.failure says so. With peers, this is rank 0 of a job whose other ranks run
// HelpToBuild: they compute features, matches and verified pairs, too, and the database has the
// same bytes.
BuildPipelineReport RunBuildPipeline(const BuildPipelineOptions& options,
                                     const RunContext& run = {}, Peers* peers = nullptr);

// What every other rank of a job does while rank 0 runs RunBuildPipeline: computes what it is sent,
// until rank 0 leaves. It needs no database, and of the options none; photographs it reads by the
// paths that rank 0 knows them by. Errors are sent to rank 0, whose run they end.
void HelpToBuild(Peers& peers);

}  // namespace cairn
