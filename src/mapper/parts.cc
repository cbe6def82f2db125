#include <algorithm>
#include <mutex>
#include <utility>

#include "cairn/base/parallel.h"
#include "mapper/image_nodes.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// A part with more verified matches has work for all threads, and may need most of the memory.
constexpr int64_t kMatchesForAllThreads = 500'000;

// Images that pairs or cameras connect: a camera whose intrinsics are refined is what all of its
// images tell. (What lies over photographs connects nothing.)
std::vector<std::set<image_t>> ConnectedImages(const SceneData& scene) {
  const ImageNodes nodes(scene.pixels);
  std::vector<GraphEdge> edges;
  for (const ViewEdge& edge : scene.edges) {
    if (edge.IsActive() || !scene.matches.at(edge.PairId()).empty()) {
      edges.push_back(nodes.EdgeOf(edge));
    }
  }
  std::map<camera_t, image_t> first_of_camera;
  for (const auto& [id, pixels] : scene.pixels) {
    const camera_t camera_id = scene.CameraIdOf(id);
    if (scene.constant_cameras.count(camera_id) > 0) continue;
    edges.push_back(nodes.EdgeOf(first_of_camera.try_emplace(camera_id, id).first->second, id));
  }
  return nodes.ConnectedBy(edges);
}

// The images of each part, the largest first. Those that are too few for a model are with these.
std::vector<std::set<image_t>> ImagesOfParts(const SceneData& scene, size_t min_images) {
  std::vector<std::set<image_t>> parts;
  for (std::set<image_t>& images : ConnectedImages(scene)) {
    if (parts.empty() || images.size() >= min_images) {
      parts.push_back(std::move(images));
    } else {
      parts.front().merge(images);
    }
  }
  return parts;
}

// Moves images with their keypoints out of the scene, and copies their cameras.
SceneData TakeImages(const std::set<image_t>& ids, SceneData& scene) {
  SceneData part;
  for (const image_t id : ids) {
    part.images.insert(*scene.images.find(id));
    part.pixels.insert(scene.pixels.extract(id));
    part.scales.insert(scene.scales.extract(id));
    const camera_t camera_id = scene.CameraIdOf(id);
    part.cameras[camera_id] = scene.cameras.at(camera_id);
    if (scene.constant_cameras.count(camera_id) > 0) part.constant_cameras.insert(camera_id);
  }
  part.raw_matches = scene.raw_matches;
  part.stored_geometry = scene.stored_geometry;
  part.poses_imported = scene.poses_imported;
  part.poses_alone = scene.poses_alone;
  part.places = scene.places;
  part.still_parts = scene.still_parts;
  return part;
}

// Pairs between parts stay in the scene.
std::vector<SceneData> TakeParts(const std::vector<std::set<image_t>>& images, SceneData& scene) {
  std::vector<SceneData> parts;
  std::map<image_t, size_t> part_of;
  for (const std::set<image_t>& ids : images) {
    for (const image_t id : ids) part_of[id] = parts.size();
    parts.push_back(TakeImages(ids, scene));
  }
  std::vector<ViewEdge> between;
  for (ViewEdge& edge : scene.edges) {
    const image_pair_t pair_id = edge.PairId();
    const size_t k = part_of.at(edge.image_id1);
    if (part_of.at(edge.image_id2) == k) {
      parts[k].matches.insert(scene.matches.extract(pair_id));
      parts[k].foreign.insert(scene.foreign.extract(pair_id));
      parts[k].edges.push_back(std::move(edge));
    } else {
      between.push_back(std::move(edge));
    }
  }
  scene.edges = std::move(between);
  return parts;
}

int64_t NumMatches(const SceneData& scene) {
  int64_t num = 0;
  for (const auto& [pair_id, matches] : scene.matches) num += std::ssize(matches);
  return num;
}

// Keeps the lines of a part that is built beside others together.
class PartMonitor : public ProgressMonitor {
 public:
  explicit PartMonitor(ProgressMonitor& run) : run_(run) {}

  void Info(const std::string& message) override { Keep(false, message); }
  void Warning(const std::string& message) override { Keep(true, message); }
  bool StopRequested() const override { return run_.StopRequested(); }

  void Show() const {
    for (const auto& [warns, message] : lines_) {
      warns ? run_.Warning(message) : run_.Info(message);
    }
  }

 private:
  void Keep(bool warns, const std::string& message) {
    const std::lock_guard<std::mutex> lock(mutex_);
    lines_.emplace_back(warns, message);
  }

  ProgressMonitor& run_;
  std::mutex mutex_;
  std::vector<std::pair<bool, std::string>> lines_;
};

// Builds the parts: large ones one after the other, then the others side by side.
class PartBuilder {
 public:
  PartBuilder(std::span<const Reconstruction> earlier, const ReconstructSettings& settings,
              const RunContext& run, std::vector<SceneData> parts)
      : earlier_(earlier), settings_(settings), run_(run), parts_(std::move(parts)) {}

  std::vector<PartResult> Build(RunReport& report) {
    results_.resize(parts_.size());
    std::vector<size_t> small;
    for (size_t k = 0; k < parts_.size(); ++k) {
      if (k == 0 || NumMatches(parts_[k]) > kMatchesForAllThreads) {
        BuildPart(k, run_.monitor);
      } else {
        small.push_back(k);
      }
    }
    if (!small.empty()) BuildSmall(small, report);
    return std::move(results_);
  }

 private:
  void BuildPart(size_t k, ProgressMonitor& monitor) {
    SceneData part = std::exchange(parts_[k], {});
    if (parts_.size() > 1) {
      monitor.Info("part " + std::to_string(k + 1) + " of " + std::to_string(parts_.size()) + ": " +
                   std::to_string(part.pixels.size()) + " images");
    }
    if (run_.monitor.StopRequested()) {
      for (const auto& [id, pixels] : part.pixels) results_[k].graph.image_ids.push_back(id);
      results_[k].graph.edges = std::move(part.edges);
    } else {
      results_[k] =
          ReconstructBest(earlier_, settings_, {run_.seed, run_.num_threads, monitor}, part);
    }
  }

  void BuildSmall(std::span<const size_t> small, RunReport& report) {
    RunStage stage(report, run_.monitor, "parts", std::ssize(small));
    std::mutex mutex;
    ParallelFor(run_.num_threads, std::ssize(small), [&](int64_t i) {
      PartMonitor monitor(run_.monitor);
      BuildPart(small[i], monitor);
      const std::lock_guard<std::mutex> lock(mutex);
      monitor.Show();
      run_.monitor.Advance(1);
    });
  }

  const std::span<const Reconstruction> earlier_;
  const ReconstructSettings& settings_;
  const RunContext& run_;
  std::vector<SceneData> parts_;
  std::vector<PartResult> results_;
};

// One graph of all parts, and one report.
void Merge(std::vector<PartResult>& parts, const SceneData& scene, const RunContext& run,
           ReconstructResult& result) {
  result.graph.edges = scene.edges;
  const bool has_models =
      std::ranges::any_of(parts, [](const PartResult& part) { return !part.models.empty(); });
  for (size_t k = 0; k < parts.size(); ++k) {
    PartResult& part = parts[k];
    std::ranges::copy(part.graph.image_ids, std::back_inserter(result.graph.image_ids));
    std::ranges::move(part.graph.edges, std::back_inserter(result.graph.edges));
    for (StageReport& stage : part.report.stages) {
      if (parts.size() > 1) stage.Add("part", static_cast<double>(k));
      result.report.stages.push_back(std::move(stage));
    }
    std::ranges::move(part.report.warnings, std::back_inserter(result.report.warnings));
    const std::string& failure = part.report.failure;
    if (has_models && !failure.empty()) run.monitor.Warning(failure);
    if (!has_models && result.report.failure.empty()) result.report.failure = failure;
  }
  result.graph.Normalize();
}

// The largest models first, with their warnings, which name their folders. Returns the images of
// models that are one too many.
std::vector<std::vector<image_t>> TakeModels(std::vector<PartResult>& parts, size_t max_models,
                                             ReconstructResult& result) {
  std::vector<std::pair<Reconstruction*, std::vector<ResultWarning>*>> built;
  for (PartResult& part : parts) {
    for (size_t i = 0; i < part.models.size(); ++i) {
      built.emplace_back(&part.models[i], &part.warnings[i]);
    }
  }
  std::ranges::stable_sort(built, std::ranges::greater(),
                           [](const auto& each) { return each.first->images.size(); });
  std::vector<std::vector<image_t>> too_many;
  for (const auto& [model, warnings] : built) {
    if (result.models.size() == max_models) {
      std::vector<image_t>& images = too_many.emplace_back();
      for (const auto& [id, image] : model->images) images.push_back(id);
      continue;
    }
    for (ResultWarning& warning : *warnings) {
      warning.what = "sparse/" + std::to_string(result.models.size()) + " (" +
                     std::to_string(model->images.size()) + " images): " + warning.what;
      result.report.warnings.push_back(std::move(warning));
    }
    result.models.push_back(std::move(*model));
  }
  return too_many;
}

// Names what is in no model.
void ReportLeftOut(const SceneData& scene, const std::vector<std::vector<image_t>>& connected,
                   bool registers, const RunContext& run, ReconstructResult& result) {
  RunStage stage(result.report, run.monitor, "left_out");
  std::set<image_t> named;
  for (const Reconstruction& model : result.models) {
    for (const auto& [id, image] : model.images) named.insert(id);
  }
  const size_t num_taken = named.size();
  for (const std::vector<image_t>& images : connected) {
    stage.Note("no model of " + std::to_string(images.size()) +
               " connected images (--reconstruct.min_model_images, --reconstruct.max_models): " +
               Names(scene, images));
    named.insert(images.begin(), images.end());
  }
  std::vector<image_t> others;
  for (const auto& [id, image] : scene.images) {
    if (named.count(id) == 0) others.push_back(id);
  }
  if (!others.empty()) {
    stage.Note(
        std::string("images in no model (") +
        (registers ? "too few verified matches with others" : "--reconstruct.register_left_out 0") +
        "): " + Names(scene, others));
  }
  stage.Add("small_components", connected.size());
  stage.Add("images", scene.images.size() - num_taken);
}

}  // namespace

ReconstructResult ReconstructParts(std::span<const Reconstruction> earlier,
                                   const ReconstructSettings& settings, const RunContext& run,
                                   SceneData& scene) {
  const ReconstructOptions& options = settings.reconstruct;
  std::vector<std::set<image_t>> images(1);
  if (earlier.empty()) {
    images = ImagesOfParts(scene, options.min_model_images);
  } else {
    for (const auto& [id, pixels] : scene.pixels) images.front().insert(id);
  }
  ReconstructResult result;
  std::vector<PartResult> parts =
      PartBuilder(earlier, settings, run, TakeParts(images, scene)).Build(result.report);
  Merge(parts, scene, run, result);
  std::vector<std::vector<image_t>> connected = TakeModels(parts, options.max_models, result);
  for (PartResult& part : parts) {
    std::ranges::move(part.without_model, std::back_inserter(connected));
  }
  if (!run.monitor.StopRequested()) {
    ReportLeftOut(scene, connected, options.register_left_out, run, result);
  }
  return result;
}

}  // namespace cairn
