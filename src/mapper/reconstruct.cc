#include "cairn/mapper/reconstruct.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/memory.h"
#include "cairn/base/timer.h"
#include "cairn/view_graph/symmetry.h"
#include "cairn/view_graph/view_graph_builder.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// What to try where the most frequent reason took all pairs out.
std::string AdviceFor(const std::map<EdgeRemoval, int>& num_removed) {
  const auto most =
      std::max_element(num_removed.begin(), num_removed.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  switch (most == num_removed.end() ? EdgeRemoval::kNone : most->first) {
    case EdgeRemoval::kNoPose:
      return "the camera seems to have turned without moving, or only a plane is seen: add photos "
             "from other places";
    case EdgeRemoval::kTripletInconsistent:
    case EdgeRemoval::kAmbiguous:
      return "the pairs contradict each other: raise --view_graph.max_triplet_error_deg, or match "
             "with a smaller --matching.max_ratio";
    default:
      return "lower --view_graph.min_num_inliers, or match more features";
  }
}

ViewGraphResult BuildGraph(const SceneData& scene, const ReconstructSettings& settings,
                           const RunContext& run, RunReport& report) {
  Stage stage(report, run.monitor, "view_graph");
  std::vector<image_t> image_ids;
  for (const auto& [id, pixels] : scene.pixels) image_ids.push_back(id);
  ViewGraphBuilderOptions options = settings.view_graph;
  if (scene.poses_imported) options.min_num_inliers = options.min_bridge_inliers = 0;
  ViewGraphResult result = BuildViewGraph(image_ids, scene.edges, options, run);
  stage.Add("edges_in", result.report.num_edges);
  stage.Add("edges_out", result.report.num_active_edges);
  for (const auto& [reason, count] : result.report.num_removed) {
    stage.Add("removed_" + std::string(EdgeRemovalName(reason)), count);
  }
  stage.Add("loops", static_cast<double>(result.report.loops.num_loops));
  stage.Add("closed_loops", static_cast<double>(result.report.loops.num_closed));
  stage.Add("median_loop_error_deg", result.report.loops.median_error_deg);
  stage.Add("components", static_cast<double>(result.report.components.size()));
  if (result.report.components.empty()) {
    std::string reasons;
    for (const auto& [reason, count] : result.report.num_removed) {
      reasons += (reasons.empty() ? "" : ", ") + std::to_string(count) + " " +
                 std::string(EdgeRemovalName(reason));
    }
    stage.Fail("of " + std::to_string(result.report.num_edges) +
                   " verified pairs none is fit for use (" + reasons + ")",
               AdviceFor(result.report.num_removed));
  }
  return result;
}

// Components that wait for their model, the largest first.
class ComponentQueue {
 public:
  struct Component {
    std::vector<image_t> images;
    bool is_part = false;  // twin places were found on the way to it
  };

  bool empty() const { return components_.empty(); }
  void Add(Component component) {
    const auto is_smaller = [&](const Component& other) {
      return other.images.size() < component.images.size();
    };
    components_.insert(std::find_if(components_.begin(), components_.end(), is_smaller),
                       std::move(component));
  }
  // Those that the active edges among these images form.
  void AddPartsOf(std::span<const image_t> images, bool is_part, ViewGraph graph) {
    KeepImages(images, graph);
    for (std::vector<image_t>& part : ActiveComponents(graph)) Add({std::move(part), is_part});
  }
  // Images that twin places on their way to a model hold.
  std::set<image_t> Reserved(int min_images) const {
    std::set<image_t> reserved;
    for (const Component& component : components_) {
      if (!component.is_part || static_cast<int>(component.images.size()) < min_images) {
        continue;
      }
      reserved.insert(component.images.begin(), component.images.end());
    }
    return reserved;
  }
  Component Pop() {
    Component component = std::move(components_.front());
    components_.erase(components_.begin());
    return component;
  }

 private:
  std::vector<Component> components_;
};

// Keeps what became of the component's edges. Those between a part that was reconstructed and what
// was cut off from it stay as they were.
void TakeOver(const ViewGraph& from, ViewGraph& graph) {
  for (size_t e = 0; e < graph.edges.size(); ++e) {
    if (from.edges[e].removal != EdgeRemoval::kOtherComponent) {
      graph.edges[e].removal = from.edges[e].removal;
    }
  }
}

std::string Names(const StageContext& context, std::span<const image_t> images) {
  constexpr size_t kMaxNames = 20;
  std::string text;
  for (size_t i = 0; i < std::min(images.size(), kMaxNames); ++i) {
    text += (i > 0 ? ", " : "") + context.scene.images.at(images[i]).name;
  }
  if (images.size() > kMaxNames) {
    text += " and " + std::to_string(images.size() - kMaxNames) + " more";
  }
  return text;
}

// Warnings of a model that contradicts its own verified pairs, or parts of it that do.
std::vector<std::string> JudgeModel(StageContext& context, const Reconstruction& model,
                                    const ModelEvidence& evidence, const ViewGraph& graph) {
  ModelStage stage(context, "judgement");
  const Symmetry symmetry = FindSymmetry(model, graph);
  stage.Add("explained_share", evidence.inside.Share());
  stage.Add("contradicted_pairs", evidence.num_contradicted);
  stage.Add("symmetric_pairs", symmetry.num_pairs);
  std::vector<std::string> warnings;
  const auto warn = [&](const std::string& what, const std::vector<image_t>& images) {
    warnings.push_back(what + (images.empty() ? "" : ": " + Names(context, images)));
    stage.Warn(warnings.back());
  };
  std::vector<image_t> doubtful;
  for (const auto& [id, support] : evidence.images) {
    if (support.IsContradicted()) doubtful.push_back(id);
  }
  std::stable_sort(doubtful.begin(), doubtful.end(), [&](image_t a, image_t b) {
    return evidence.images.at(a).Share() < evidence.images.at(b).Share();
  });
  const std::string percent = std::to_string(std::lround(100 * evidence.inside.Share()));
  if (evidence.inside.IsContradicted()) {
    warn("it explains only " + percent +
             " % of the verified matches of its images and is probably wrong; worst",
         doubtful);
  } else if (!doubtful.empty()) {
    warn(std::to_string(doubtful.size()) +
             " images contradict most of their verified matches and are probably misplaced",
         doubtful);
  }
  if (symmetry.IsFold()) {
    warn(
        std::to_string(symmetry.num_pairs) +
            " pairs that are not in use agree that the scene looks the same when turned by " +
            std::to_string(std::lround(symmetry.angle_deg)) + " degrees (" +
            std::to_string(symmetry.num_active) +
            " pairs agree with the model): equal sides of a building may be shown as one. Give the "
            "photos of each side to a run of their own, or add photos with more of the "
            "surroundings. These pairs are of",
        symmetry.images);
  }
  return warnings;
}

// Names what is in no model.
void ReportLeftOut(StageContext& context, const std::vector<std::vector<image_t>>& small) {
  Stage stage(context.report, context.run.monitor, "left_out");
  std::set<image_t> named = context.taken;
  for (const std::vector<image_t>& images : small) {
    stage.Note("no model of " + std::to_string(images.size()) +
               " connected images (--reconstruct.min_model_images, --reconstruct.max_models): " +
               Names(context, images));
    named.insert(images.begin(), images.end());
  }
  std::vector<image_t> others;
  for (const auto& [id, image] : context.scene.images) {
    if (named.count(id) == 0) others.push_back(id);
  }
  if (!others.empty()) {
    stage.Note("images in no model (too few verified matches with others): " +
               Names(context, others));
  }
  stage.Add("small_components", static_cast<double>(small.size()));
  stage.Add("images", static_cast<double>(context.scene.images.size() - context.taken.size()));
}

// The largest model first; the warnings of each, in the report, name its folder.
void SortBySize(const std::vector<std::vector<std::string>>& warnings, ReconstructResult& result) {
  std::vector<size_t> order(result.models.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return result.models[a].images.size() > result.models[b].images.size();
  });
  std::vector<Reconstruction> sorted;
  for (const size_t i : order) {
    sorted.push_back(std::move(result.models[i]));
    for (const std::string& warning : warnings[i]) {
      result.report.warnings.push_back("sparse/" + std::to_string(sorted.size() - 1) + " (" +
                                       std::to_string(sorted.back().images.size()) +
                                       " images): " + warning);
    }
  }
  result.models = std::move(sorted);
}

// Models of all components, into result. Returns their evidence, nats.
double BuildModels(StageContext& context, ViewGraphResult& view_graph, ReconstructResult& result) {
  const ReconstructOptions& options = context.settings.reconstruct;
  ViewGraph& graph = view_graph.graph;
  ComponentQueue queue;
  for (const std::vector<image_t>& images : view_graph.report.components) queue.Add({images});
  std::vector<std::vector<image_t>> small;
  std::string first_failure;
  std::vector<std::vector<std::string>> warnings;  // of each model
  double evidence_nats = 0;
  for (bool is_first = true; !queue.empty(); is_first = false) {
    if (context.run.monitor.StopRequested()) {
      context.report.failure = "stopped by the user after " + std::to_string(result.models.size()) +
                               " models; run again to reconstruct";
      break;
    }
    const ComponentQueue::Component component = queue.Pop();
    const bool is_small = static_cast<int>(component.images.size()) < options.min_model_images;
    if ((is_small && !is_first) || static_cast<int>(result.models.size()) == options.max_models) {
      small.push_back(component.images);
      continue;
    }
    context.reserved = queue.Reserved(options.min_model_images);
    BuiltModel built = BuildModel(context, component.images, graph);
    TakeOver(built.graph, graph);
    for (const size_t e : built.duplicate_edges) graph.edges[e].removal = EdgeRemoval::kAmbiguous;
    if (built.model) {
      warnings.emplace_back();
      if (!context.scene.poses_alone) {
        warnings.back() = JudgeModel(context, *built.model, built.evidence, built.graph);
      }
      evidence_nats += built.evidence.nats;
      for (const auto& [id, image] : built.model->images) context.taken.insert(id);
      std::vector<image_t> rest;
      for (const image_t id : component.images) {
        if (context.taken.count(id) == 0) rest.push_back(id);
      }
      if (rest.size() >= 2) queue.AddPartsOf(rest, component.is_part, graph);
      result.models.push_back(std::move(*built.model));
    } else if (!built.duplicate_edges.empty()) {
      queue.AddPartsOf(component.images, true, graph);
    } else {
      // A component that fails does not spoil the models that there are.
      context.run.monitor.Warning(context.report.failure);
      if (first_failure.empty()) first_failure = context.report.failure;
      context.report.failure.clear();
      small.push_back(component.images);
    }
    context.model = static_cast<int>(result.models.size());
  }
  if (result.models.empty() && context.report.Succeeded()) context.report.failure = first_failure;
  ReportLeftOut(context, small);
  SortBySize(warnings, result);
  return evidence_nats;
}

// Graph and models with the scene's calibration.
struct CalibratedResult {
  ReconstructResult result;
  double evidence_nats = 0;
};
CalibratedResult ReconstructCalibrated(const SceneData& scene, const ReconstructSettings& settings,
                                       const RunContext& run) {
  CalibratedResult calibrated;
  ReconstructResult& result = calibrated.result;
  ViewGraphResult graph = BuildGraph(scene, settings, run, result.report);
  if (result.report.Succeeded()) {
    StageContext context{scene, settings, run, result.report};
    calibrated.evidence_nats = BuildModels(context, graph, result);
  }
  result.graph = std::move(graph.graph);
  return calibrated;
}

// With the scene's calibration and, where its pairs could not tell which of two is right, with the
// other one: the result with more evidence.
ReconstructResult ReconstructBest(SceneData& scene, const ReconstructSettings& settings,
                                  const RunContext& run) {
  CalibratedResult best = ReconstructCalibrated(scene, settings, run);
  if (!scene.alternative || run.monitor.StopRequested()) return std::move(best.result);
  run.monitor.Info(
      "reconstructed again with the focal lengths that were there before: pairs could not "
      "tell which are right");
  std::swap(scene.cameras, scene.alternative->cameras);
  std::swap(scene.edges, scene.alternative->edges);
  CalibratedResult other = ReconstructCalibrated(scene, settings, run);
  const bool takes_other = other.evidence_nats > best.evidence_nats;
  if (takes_other) std::swap(best, other);
  // What was tried stays in the report.
  std::vector<StageReport>& stages = best.result.report.stages;
  stages.insert(stages.begin(), other.result.report.stages.begin(),
                other.result.report.stages.end());
  StageReport stage;
  stage.name = "focal_choice";
  stage.Add("calibrated", takes_other ? 0 : 1);
  stage.Add("evidence_nats", best.evidence_nats);
  stage.Add("evidence_nats_otherwise", other.evidence_nats);
  stages.push_back(std::move(stage));
  return std::move(best.result);
}

void ColorModels(const SceneData& scene, const std::string& image_path,
                 const ReconstructSettings& settings, const RunContext& run,
                 ReconstructResult& result) {
  StageContext context{scene, settings, run, result.report};
  for (Reconstruction& model : result.models) {
    if (!model.points3D.empty()) ColorPoints(context, image_path, model);
    ++context.model;
  }
}

}  // namespace

void ReconstructOptions::VisitFields(OptionVisitor& v) {
  v.Int("min_model_images", min_model_images, {2, 1000000},
        "images that a model needs; the largest component is always tried");
  v.Int("max_models", max_models, {1, 1000000}, "largest number of models");
  v.Int("position_tracks_per_image", position_tracks_per_image, {0, 1000000},
        "tracks an image whose rays join translation averaging");
  v.Int("coarse_tracks_per_image", coarse_tracks_per_image, {0, 1000000},
        "tracks an image in the first rounds; 0: all");
  v.Double("coarse_error_factor", coarse_error_factor, {1, 1000},
           "how much larger errors may be in the first round");
  v.Int("max_rounds", max_rounds, {1, 1000},
        "rounds of triangulation, adjustment and filtering over all tracks");
  v.Double("min_gain", min_gain, {0, 1}, "rounds end when one adds relatively fewer observations");
  v.Int("min_image_points", min_image_points, {3, 1000000},
        "an image with fewer points is removed");
  v.Double("max_memory_gib", max_memory_gib, {0, 1e6},
           "memory of the whole program; where bundle adjustment would take more, it gets fewer "
           "tracks; 0: what the machine has left");
  v.Bool("register_left_out", register_left_out,
         "try images that were left out again, by resection");
  v.Bool("separate_duplicates", separate_duplicates,
         "detect duplicate structure, places that look alike, and reconstruct them separately");
  v.Bool("refine_principal_points", refine_principal_points,
         "adjust the principal points of cameras whose intrinsics are not constant, near the image "
         "centers (focal_calibration.principal_point_sigma)");
  v.Bool("colors", colors, "color the points from the photographs");
}

ReconstructResult Reconstruct(const Database& database, const std::string& image_path,
                              const ReconstructSettings& settings, const RunContext& run) {
  ReconstructSettings(settings).VisitModules(
      [](const char* module, auto& options) { ValidateOptions(options, module); });
  const Timer timer;
  RunReport read;
  SceneData scene = ReadSceneData(database, settings, run, read);
  ReconstructResult result;
  if (read.Succeeded()) {
    result = ReconstructBest(scene, settings, run);
    if (settings.reconstruct.colors && !image_path.empty()) {
      ColorModels(scene, image_path, settings, run, result);
    }
  } else {
    result.report.failure = read.failure;
  }
  for (const auto& [id, image] : scene.images) result.images.push_back(image);
  RunReport& report = result.report;
  report.program = "global_sfm reconstruct";
  report.seed = run.seed;
  report.num_threads = run.num_threads;
  report.stages.insert(report.stages.begin(), read.stages.begin(), read.stages.end());
  size_t num_registered = 0;
  for (const Reconstruction& model : result.models) num_registered += model.images.size();
  report.values = {{"images", static_cast<double>(scene.images.size())},
                   {"registered", static_cast<double>(num_registered)},
                   {"models", static_cast<double>(result.models.size())},
                   {"seconds", timer.Seconds()},
                   {"peak_memory_gib", BytesToGib(std::max<int64_t>(0, ReadMemoryUse().peak))}};
  return result;
}

}  // namespace cairn
