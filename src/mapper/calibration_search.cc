#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "mapper/stages.h"

namespace cairn {
namespace {

// How much more many cameras explain than one for all where focal lengths absorb errors of other
// kinds.
constexpr double kAbsorbedErrors = 0.05;

// Nearly all loops of three rotations close: pairs have right poses, whatever their intrinsics.
bool AgreeAround(const LoopReport& loops) {
  return 10 * (loops.num_loops - loops.num_closed) < loops.num_loops;
}

// Graph and models by one calibration.
struct CalibratedResult {
  PartResult result;
  std::string origin;  // of the calibration, in words
  // Many cameras must explain so much more than one camera for all.
  double least_gain = 0;
  std::set<image_t> left_exif;
  // Where the models are quick to build once more, and pairs contradict each other.
  std::optional<Calibration> calibration;

  double Score() const {
    return result.evidence_nats - least_gain * std::max(0.0, result.evidence_nats);
  }
};

CalibratedResult ReconstructCalibrated(const SceneData& scene,
                                       std::span<const Reconstruction> earlier,
                                       const ReconstructSettings& settings, const RunContext& run) {
  CalibratedResult calibrated;
  PartResult& result = calibrated.result;
  calibrated.origin = scene.origin;
  ViewGraphResult graph = BuildSceneGraph(scene, settings, run, result.report);
  if (result.report.Succeeded()) {
    StageContext context{scene, settings, run, result.report};
    static_cast<SceneModels&>(result) =
        BuildModels(context, graph.report.components, earlier, graph.graph);
    for (Reconstruction& model : result.models) UnshareCamera(scene.stored_cameras, model);
    calibrated.left_exif =
        ImagesThatLeftExif(scene, settings.focal_calibration.exif_sigma, result.models);
  }
  result.graph = std::move(graph.graph);
  if (!AgreeAround(graph.report.loops) && std::ranges::all_of(result.models, IsQuick)) {
    calibrated.calibration = scene;
  }
  return calibrated;
}

// Finished models, adjusted and grown by the calibration of the scene. nullopt: there is not enough
// memory.
std::optional<CalibratedResult> AdjustModels(const SceneData& scene, const PartResult& finished,
                                             const ReconstructSettings& settings,
                                             const RunContext& run) {
  CalibratedResult adjusted;
  StageContext context{scene, settings, run, adjusted.result.report};
  ViewGraph graph = finished.graph;
  for (Reconstruction model : finished.models) {
    AdjustModel(context, std::numeric_limits<int>::max(), model);
    if (!GrowModel(context, graph, model)) return std::nullopt;
    adjusted.result.evidence_nats += EvidenceFor(context, model, graph).nats;
    for (const auto& [id, image] : model.images) context.taken.insert(id);
    ++context.model;
    adjusted.result.models.push_back(std::move(model));
  }
  return adjusted;
}

// Reconstructs by one calibration after the other and keeps the best result.
class CalibrationSearch {
 public:
  // may_share: one of the calibrations has one camera for many images.
  CalibrationSearch(bool may_share, const ReconstructSettings& settings, const RunContext& run,
                    SceneData& scene)
      : may_share_(may_share), settings_(settings), run_(run), scene_(scene) {
    choice_.name = "calibration_choice";
  }

  // Reconstructs by the scene's calibration, which is better than the best so far if its score is
  // more than this share of the best one's. Returns whether it is.
  bool Try(double least_share = 1) {
    const bool is_first = choice_.messages.empty();
    if (!is_first && run_.monitor.StopRequested()) return false;
    if (!is_first) run_.monitor.Info("once more, with " + scene_.origin);
    CalibratedResult result = ReconstructCalibrated(scene_, {}, settings_, run_);
    if (may_share_ && scene_.stored_cameras.empty()) {
      result.least_gain = LeastGain(result.result.models);
    }
    choice_.messages.push_back(std::to_string(std::llround(result.result.evidence_nats)) +
                               " nats of evidence with " + scene_.origin);
    const bool is_best = is_first || result.Score() > least_share * best_.Score();
    if (is_best) std::swap(result, best_);
    Keep(result);
    return is_best;
  }

  const CalibratedResult& best() const { return best_; }

  // Once more with the intrinsics of the best models, as long as that explains more: where focal
  // lengths are guessed, or of photographs that were cropped, pairs have poses of the wrong ones.
  void TryFound() {
    while (best_.calibration && !ExplainsAll()) {
      static_cast<Calibration&>(scene_) = *best_.calibration;
      if (!TakeIntrinsics(best_.result.models, run_, scene_) || !Try(1 + kModelErrors)) break;
    }
  }

  // Whether the scene's cameras are worth models of their own, where the best models have one
  // camera for many images: with these cameras they have more evidence, or there are none.
  bool SeparatePays() {
    if (run_.monitor.StopRequested()) return false;
    if (best_.result.models.empty()) return true;
    separate_ = AdjustModels(scene_, best_.result, settings_, run_);
    choice_.messages.push_back(
        (separate_
             ? std::to_string(std::llround(separate_->result.evidence_nats)) + " nats of evidence"
             : "not enough memory to look") +
        " where these models have " + scene_.origin);
    if (!separate_) return false;
    Keep(*separate_);
    separate_->least_gain = kModelErrors;
    return separate_->Score() > best_.Score();
  }

  // The same, once pairs calibrated these cameras, and confirm the focal lengths of these models or
  // not.
  bool SeparateStillPays() {
    if (!separate_) return true;
    separate_->least_gain = LeastGain(separate_->result.models);
    if (separate_->Score() > best_.Score()) return true;
    choice_.messages.push_back("pairs do not confirm the focal lengths of these models");
    return false;
  }

  // What was tried stays in the report.
  PartResult Finish() {
    if (choice_.messages.size() > 1) {
      choice_.Add("evidence_nats", best_.result.evidence_nats);
      choice_.Add("evidence_nats_otherwise", otherwise_);
      choice_.messages.push_back("the models are those with " + best_.origin);
      for (const std::string& message : choice_.messages) run_.monitor.Info(message);
      std::vector<StageReport>& stages = best_.result.report.stages;
      stages.insert(stages.begin(), tried_.begin(), tried_.end());
      stages.push_back(std::move(choice_));
    }
    return std::move(best_.result);
  }

 private:
  // But for what camera models leave out.
  bool ExplainsAll() const {
    double num_matches = 0;
    for (const auto& [pair_id, matches] : scene_.matches) {
      num_matches += static_cast<double>(matches.size());
    }
    return static_cast<double>(best_.result.num_explained) >= (1 - kModelErrors) * num_matches;
  }

  // What separate cameras must explain more, if these models have them.
  double LeastGain(std::span<const Reconstruction> models) const {
    return PairsConfirmFocals(scene_, models) ? kModelErrors : kAbsorbedErrors;
  }

  void Keep(const CalibratedResult& tried) {
    otherwise_ = std::max(otherwise_, tried.result.evidence_nats);
    const std::vector<StageReport>& stages = tried.result.report.stages;
    tried_.insert(tried_.end(), stages.begin(), stages.end());
  }

  const bool may_share_;
  const ReconstructSettings& settings_;
  const RunContext& run_;
  SceneData& scene_;
  CalibratedResult best_;
  std::optional<CalibratedResult> separate_;  // the best models, adjusted with separate cameras
  double otherwise_ = 0;
  std::vector<StageReport> tried_;
  StageReport choice_;  // a message for each calibration
};

// Calibrates the scene by its pairs. Returns whether these dispute the cameras that images share.
bool Calibrate(const ReconstructSettings& settings, const RunContext& run, RunReport& report,
               SceneData& scene) {
  if (scene.poses_alone) return false;
  if (settings.focal_calibration.enabled && scene.constant_cameras.size() < scene.cameras.size()) {
    RunStage stage(report, run.monitor, "focal_calibration");
    return CalibrateSceneFocals(settings, run, stage, scene);
  }
  ImproveRelativePoses(scene.foreign, run, scene);
  return false;
}

// Gives the images of each group the median of their cameras.
void Share(const std::vector<std::set<image_t>>& groups, const RunContext& run, SceneData& scene) {
  std::string shared;
  for (const std::set<image_t>& images : groups) {
    std::vector<Camera> cameras;
    for (const image_t id : images) cameras.push_back(scene.CameraOf(id));
    ShareCamera(images, MedianCamera(std::move(cameras)), run, scene);
    shared += (shared.empty() ? "one camera for " : ", one for ") + std::to_string(images.size()) +
              " images";
  }
  if (!shared.empty()) scene.origin = shared;
}

// Where no earlier model tells the calibration. `of_one`: groups of images, likely of one camera
// each.
PartResult SearchCalibration(const std::vector<std::set<image_t>>& of_one,
                             const ReconstructSettings& settings, const RunContext& run,
                             RunReport& report, SceneData& scene) {
  Calibration& calibration = scene;
  std::optional<Calibration> stored;
  const auto refines_exif = [&](const auto& entry) { return RefinesExif(entry.second, scene); };
  if (std::ranges::any_of(scene.cameras, refines_exif)) stored = scene;
  CalibrationSearch search(!of_one.empty(), settings, run, scene);
  const auto calibrate_and_try = [&] {
    const bool is_disputed = Calibrate(settings, run, report, scene);
    search.Try();
    return is_disputed;
  };
  if (!of_one.empty()) {
    Calibration separate = scene;
    Share(of_one, run, scene);
    const bool is_disputed = calibrate_and_try();
    calibration = std::move(separate);
    if (is_disputed || search.SeparatePays()) {
      Calibrate(settings, run, report, scene);
      if (search.SeparateStillPays()) search.Try();
    }
  } else {
    calibrate_and_try();
  }
  if (!search.best().left_exif.empty()) {
    calibration = std::move(*stored);
    Share(of_one, run, scene);
    // (An observation of bundle adjustment has two coordinates, a match one.)
    HoldExif(search.best().left_exif, settings.focal_calibration.exif_sigma,
             2 * kModelErrors * search.best().result.evidence_nats, scene);
    Calibrate(settings, run, report, scene);
    search.Try(1 - kModelErrors);
  }
  search.TryFound();
  return search.Finish();
}

}  // namespace

PartResult ReconstructBest(std::span<const Reconstruction> earlier,
                           const ReconstructSettings& settings, const RunContext& run,
                           SceneData& scene) {
  RunReport before;  // the models
  std::vector<std::set<image_t>> of_one;
  if (settings.reconstruct.share_camera && !scene.poses_alone) of_one = LikelyOfOneCamera(scene);
  scene.origin = "the cameras of the database";
  PartResult result;
  if (earlier.empty()) {
    const std::set<image_t> turned = TurnAlike(of_one, scene);
    result = SearchCalibration(of_one, settings, run, before, scene);
    TurnBack(turned, scene, result);
  } else {
    std::erase_if(of_one, [&](const std::set<image_t>& images) {
      return !AgreeWithOneCamera(earlier, images, scene);
    });
    Share(of_one, run, scene);
    Calibrate(settings, run, before, scene);
    const std::vector<Reconstruction> adopted =
        AdoptModels(earlier, scene, settings.reconstruct, run, before);
    if (before.Succeeded()) {
      result = ReconstructCalibrated(scene, adopted, settings, run).result;
    } else {
      for (const auto& [id, pixels] : scene.pixels) result.graph.image_ids.push_back(id);
      result.graph.edges = scene.edges;
    }
  }
  if (!before.Succeeded()) result.report.failure = before.failure;
  RunReport& report = result.report;
  report.stages.insert(report.stages.begin(), before.stages.begin(), before.stages.end());
  report.warnings.insert(report.warnings.begin(), before.warnings.begin(), before.warnings.end());
  return result;
}

}  // namespace cairn
