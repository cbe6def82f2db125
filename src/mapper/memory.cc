#include "base/memory.h"

#include <algorithm>
#include <limits>
#include <unordered_map>

#include "base/text.h"
#include "bundle_adjustment/memory_estimate.h"
#include "cairn/base/parallel.h"
#include "mapper/stages.h"
#include "sparse/block_cholesky.h"

namespace cairn {
namespace {

// Fewer tracks an image do not hold a model together.
constexpr int kMinTracksPerImage = 50;

// Of a prediction that the user sees at once. (The report has all.)
constexpr int64_t kBytesWorthALine = int64_t{1} << 30;

std::string Gib(int64_t bytes) { return Formatted("%.2f GiB", BytesToGib(bytes)); }

// Blocks of the poses of the model's images that see one of the tracks together.
BlockPattern PatternOfPoses(const Reconstruction& model, std::span<const Track> tracks) {
  constexpr int kPoseSize = 6;
  const size_t num_images = model.images.size();
  std::unordered_map<image_t, size_t> index;
  for (const auto& [id, image] : model.images) index.emplace(id, index.size());
  std::vector<std::vector<bool>> see_together(num_images, std::vector<bool>(num_images, false));
  std::vector<size_t> used;
  for (const Track& track : tracks) {
    used.clear();
    for (const TrackElement& element : track) {
      const auto image = index.find(element.image_id);
      if (image != index.end()) used.push_back(image->second);
    }
    for (const size_t i : used) {
      for (const size_t j : used) see_together[i][j] = true;
    }
  }
  BlockPattern pattern{std::vector<int>(num_images, kPoseSize),
                       std::vector<std::vector<int>>(num_images)};
  for (size_t i = 0; i < num_images; ++i) {
    pattern.columns[i].push_back(static_cast<int>(i));
    for (size_t j = i + 1; j < num_images; ++j) {
      if (see_together[i][j]) pattern.columns[i].push_back(static_cast<int>(j));
    }
  }
  return pattern;
}

// Of the camera that has most.
int MostParams(const std::map<camera_t, Camera>& cameras) {
  size_t most = 0;
  for (const auto& [id, camera] : cameras) most = std::max(most, camera.params.size());
  return static_cast<int>(most);
}

BundleSize SizeOf(const Reconstruction& model, std::span<const Track> tracks,
                  const BundleAdjustmentOptions& options) {
  BundleSize size;
  size.num_images = static_cast<int64_t>(model.images.size());
  for (const auto& [id, image] : model.images) {
    size.num_keypoints += static_cast<int64_t>(image.points2D.size());
  }
  size.num_free_intrinsics = MostParams(model.cameras);
  size.has_own_cameras = 2 * model.cameras.size() > model.images.size();
  double num_pairs = 0;
  for (const Track& track : tracks) {
    int64_t num_used = 0;
    for (const TrackElement& element : track) num_used += model.images.contains(element.image_id);
    if (num_used < 2) continue;
    ++size.num_points;
    size.num_observations += num_used;
    num_pairs += static_cast<double>(num_used * num_used);
  }
  if (size.num_observations > 0) {
    size.covisibility = num_pairs / static_cast<double>(size.num_observations);
  }
  if (options.solver != BundleSolver::kAuto || size.num_observations == 0) return size;
  const BlockPattern pattern = PatternOfPoses(model, tracks);
  for (const std::vector<int>& column : pattern.columns) size.num_image_pairs += std::ssize(column);
  size.factor_flops = EstimateFactorFlops(pattern);
  return size;
}

// What the option allows, or what the machine has left.
int64_t MemoryLimit(const ReconstructOptions& options, const MemoryUse& use) {
  if (options.max_memory_gib > 0) return GibToBytes(options.max_memory_gib);
  if (use.available < 0) return std::numeric_limits<int64_t>::max();
  return std::max<int64_t>(0, use.resident) + use.available;
}

std::string MemoryAdvice(const ReconstructOptions& options) {
  return options.max_memory_gib > 0 ? "raise --reconstruct.max_memory_gib"
                                    : "use a machine with more memory, or reconstruct fewer images";
}

// What bundle adjustment of a set of tracks would take.
struct BundleNeed {
  int64_t bytes = 0;
  int64_t observations = 0;
  int64_t max_observations = 0;  // of its solver
};

// What bundle adjustment of a model may take, and what tracks of it would.
class BundleBudget {
 public:
  BundleBudget(const StageContext& context, const Reconstruction& model)
      : model_(model), options_(context.settings.bundle_adjustment) {
    const MemoryUse use = ReadMemoryUse();
    resident_ = std::max<int64_t>(0, use.resident);
    limit_bytes_ = MemoryLimit(context.settings.reconstruct, use);
  }
  int64_t resident() const { return resident_; }
  int64_t limit_bytes() const { return limit_bytes_; }

  BundleNeed Need(std::span<const Track> tracks) const {
    const BundleSize size = SizeOf(model_, tracks, options_);
    return {resident_ + EstimateBundleBytes(options_, size), size.num_observations,
            MaxBundleObservations(options_, size)};
  }
  bool Allows(const BundleNeed& need) const {
    return need.bytes <= limit_bytes_ && need.observations <= need.max_observations;
  }
  // Which limit a need exceeds.
  std::string Excess(const BundleNeed& need) const {
    if (need.bytes > limit_bytes_) {
      return Gib(need.bytes) + " needed, " + Gib(limit_bytes_) + " available";
    }
    return std::to_string(need.observations) + " observations, of which the solver takes " +
           std::to_string(need.max_observations);
  }
  // The most tracks an image that are allowed, found by bisection to a twentieth.
  int MostTracksPerImage(std::span<const Track> tracks) const {
    int too_many = 1 << 20, enough = kMinTracksPerImage;
    while (too_many - enough > std::max(1, enough / 20)) {
      const int middle = enough + (too_many - enough) / 2;
      (Allows(Need(SelectTracks(tracks, middle))) ? enough : too_many) = middle;
    }
    return enough;
  }

 private:
  const Reconstruction& model_;
  const BundleAdjustmentOptions& options_;
  int64_t resident_ = 0;
  int64_t limit_bytes_ = 0;
};

// Peak memory, bytes, from reading such a database until there are tracks.
int64_t EstimateSceneBytes(const SceneCounts& counts) {
  // A keypoint: pixel, scale, the first one at its position; of tracks its node, element, parent,
  // next one, image and size; again in the model with the point it shows.
  constexpr int64_t kKeypoint = 16 + 4 + 4 + 4 + 8 + 4 + 4 + 4 + 4 + 16 + 8;
  // An edge in the scene, before calibration, in the graph, and copies of a component and of its
  // model; in the map of matches.
  constexpr int64_t kPair = 5 * sizeof(ViewEdge) + 96;
  return counts.num_keypoints * kKeypoint + counts.num_pairs * kPair +
         counts.num_matches * static_cast<int64_t>(sizeof(FeatureMatch));
}

}  // namespace

bool FitsToRead(const SceneCounts& counts, const ReconstructOptions& options, RunStage& stage) {
  const MemoryUse use = ReadMemoryUse();
  const int64_t bytes = std::max<int64_t>(0, use.resident) + EstimateSceneBytes(counts);
  const int64_t limit = MemoryLimit(options, use);
  stage.Add("estimated_gib", BytesToGib(bytes));
  if (bytes <= limit) return true;
  stage.Fail("the memory is too small for " + std::to_string(counts.num_pairs) + " pairs with " +
                 std::to_string(counts.num_matches) + " matches of " +
                 std::to_string(counts.num_keypoints) + " keypoints: " + Gib(bytes) +
                 " needed to find tracks, " + Gib(limit) + " available",
             MemoryAdvice(options));
  return false;
}

int64_t EstimatePartBytes(const SceneData& part, const BundleAdjustmentOptions& options) {
  BundleSize size;
  size.num_images = std::ssize(part.pixels);
  for (const auto& [id, pixels] : part.pixels) size.num_keypoints += std::ssize(pixels);
  // At most: a point for each match, which two images see.
  for (const auto& [pair_id, matches] : part.matches) size.num_points += std::ssize(matches);
  size.num_observations = 2 * size.num_points;
  size.covisibility = 2;
  size.num_image_pairs = std::ssize(part.edges);
  size.num_free_intrinsics = MostParams(part.cameras);
  size.has_own_cameras = 2 * part.cameras.size() > part.pixels.size();
  return EstimateBundleBytes(options, size);
}

int NumPartsSideBySide(int64_t bytes, const ReconstructOptions& options, int num_threads) {
  const MemoryUse use = ReadMemoryUse();
  const int64_t left = MemoryLimit(options, use) - std::max<int64_t>(0, use.resident);
  return static_cast<int>(std::clamp<int64_t>(left / bytes, 1, EffectiveNumThreads(num_threads)));
}

bool FitTracksToMemory(StageContext& context, const Reconstruction& model,
                       std::vector<Track>& tracks) {
  ModelStage stage(context, "memory");
  const BundleBudget budget(context, model);
  const BundleNeed wanted = budget.Need(tracks);
  stage.Add("tracks_in", tracks.size());
  stage.Add("resident_gib", BytesToGib(budget.resident()));
  stage.Add("estimated_peak_gib", BytesToGib(wanted.bytes));
  if (budget.limit_bytes() < std::numeric_limits<int64_t>::max()) {
    stage.Add("limit_gib", BytesToGib(budget.limit_bytes()));
  }
  const std::string prediction = "triangulation and bundle adjustment of " +
                                 std::to_string(model.images.size()) + " images and " +
                                 std::to_string(tracks.size()) + " tracks: predicted peak memory " +
                                 Gib(wanted.bytes) + ", " + Gib(budget.resident()) + " in use now";
  if (wanted.bytes >= kBytesWorthALine) {
    stage.Note(prediction);
  } else {
    stage.Record(prediction);
  }
  if (!budget.Allows(wanted)) {
    const int per_image = budget.MostTracksPerImage(tracks);
    std::vector<Track> fitting = SelectTracks(tracks, per_image);
    const BundleNeed need = budget.Need(fitting);
    if (!budget.Allows(need)) {
      stage.Fail(
          "even with " + std::to_string(per_image) + " tracks an image, " + budget.Excess(need),
          MemoryAdvice(context.settings.reconstruct));
      return false;
    }
    stage.Warn(budget.Excess(wanted) + ": " + std::to_string(fitting.size()) + " of " +
               std::to_string(tracks.size()) + " tracks are used, at least " +
               std::to_string(per_image) + " an image");
    tracks = std::move(fitting);
    stage.Add("reduced_peak_gib", BytesToGib(need.bytes));
  }
  stage.Add("tracks_out", tracks.size());
  return true;
}

}  // namespace cairn
