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
std::vector<std::set<image_t>> ImagesThatShare(const SceneData& scene) {
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
    if (scene.constant_cameras.contains(camera_id)) continue;
    edges.push_back(nodes.EdgeOf(first_of_camera.try_emplace(camera_id, id).first->second, id));
  }
  return nodes.ConnectedBy(edges);
}

// The images of each part, the largest first. Those that are too few for a model are with these.
std::vector<std::set<image_t>> ImagesOfParts(const SceneData& scene, size_t min_images) {
  std::vector<std::set<image_t>> parts;
  for (std::set<image_t>& images : ImagesThatShare(scene)) {
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
    if (scene.constant_cameras.contains(camera_id)) part.constant_cameras.insert(camera_id);
  }
  static_cast<SceneFacts&>(part) = scene;
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

// Builds the parts, the largest first, until there are as many models as there may be: large parts
// one after the other, then the others side by side.
class PartBuilder {
 public:
  PartBuilder(std::span<const Reconstruction> earlier, const ReconstructSettings& settings,
              const RunContext& run, std::vector<SceneData> parts)
      : earlier_(earlier),
        settings_(settings),
        run_(run),
        parts_(std::move(parts)),
        results_(parts_.size()) {}

  std::vector<PartResult> Build(RunReport& report) {
    std::vector<size_t> small;
    for (size_t k = 0; k < parts_.size(); ++k) {
      if (k > 0 && NumMatches(parts_[k]) <= kMatchesForAllThreads) {
        small.push_back(k);
      } else if (NumMissing() > 0) {
        BuildPart(k, run_.monitor);
      }
    }
    while (!small.empty() && NumMissing() > 0) {
      const size_t num = std::min(small.size(), NumMissing());
      BuildSideBySide(std::span(small).first(num), report);
      small.erase(small.begin(), small.begin() + static_cast<std::ptrdiff_t>(num));
    }
    for (size_t k = 0; k < parts_.size(); ++k) LeaveOut(k);
    return std::move(results_);
  }

 private:
  // Models that there may be.
  size_t NumMissing() const {
    const size_t most = static_cast<size_t>(settings_.reconstruct.max_models);
    size_t num_models = 0;
    for (const PartResult& result : results_) num_models += result.models.size();
    return run_.monitor.StopRequested() || num_models >= most ? 0 : most - num_models;
  }

  void BuildPart(size_t k, ProgressMonitor& monitor) {
    SceneData part = std::exchange(parts_[k], {});
    if (parts_.size() > 1) {
      monitor.Info("part " + std::to_string(k + 1) + " of " + std::to_string(parts_.size()) + ": " +
                   std::to_string(part.pixels.size()) + " images");
    }
    results_[k] =
        ReconstructBest(earlier_, settings_, {run_.seed, run_.num_threads, monitor}, part);
  }

  void BuildSideBySide(std::span<const size_t> parts, RunReport& report) {
    RunStage stage(report, run_.monitor, "parts", std::ssize(parts));
    int64_t most_bytes = 1;
    for (const size_t k : parts) {
      most_bytes = std::max(most_bytes, EstimatePartBytes(parts_[k], settings_.bundle_adjustment));
    }
    const int num_threads = NumPartsSideBySide(most_bytes, settings_.reconstruct, run_.num_threads);
    std::mutex mutex;
    ParallelFor(num_threads, std::ssize(parts), [&](int64_t i) {
      if (run_.monitor.StopRequested()) return;
      PartMonitor monitor(run_.monitor);
      BuildPart(parts[i], monitor);
      results_[parts[i]].is_side_by_side = true;
      const std::lock_guard<std::mutex> lock(mutex);
      monitor.Show();
      run_.monitor.Advance(1);
    });
  }

  // A part that was not built.
  void LeaveOut(size_t k) {
    if (parts_[k].pixels.empty()) return;
    PartResult& result = results_[k];
    for (const auto& [id, pixels] : parts_[k].pixels) result.graph.image_ids.push_back(id);
    result.graph.edges = std::move(parts_[k].edges);
    result.without_model.push_back({result.graph.image_ids});
  }

  const std::span<const Reconstruction> earlier_;
  const ReconstructSettings& settings_;
  const RunContext& run_;
  std::vector<SceneData> parts_;
  std::vector<PartResult> results_;
};

}  // namespace

ReconstructResult ReconstructParts(std::span<const Reconstruction> earlier,
                                   const ReconstructSettings& settings, const RunContext& run,
                                   SceneData& scene) {
  std::vector<std::set<image_t>> images(1);
  if (earlier.empty()) {
    images = ImagesOfParts(scene, settings.reconstruct.min_model_images);
  } else {
    for (const auto& [id, pixels] : scene.pixels) images.front().insert(id);
  }
  RunReport report;
  std::vector<PartResult> parts =
      PartBuilder(earlier, settings, run, TakeParts(images, scene)).Build(report);
  return MergeParts(std::move(parts), scene, settings.reconstruct, run, std::move(report));
}

}  // namespace cairn
