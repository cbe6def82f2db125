#include "base/memory.h"

#include <algorithm>
#include <cstdio>
#include <limits>

#include "bundle_adjustment/memory_estimate.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// Fewer tracks an image do not hold a model together.
constexpr int kMinTracksPerImage = 50;

std::string Gib(int64_t bytes) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.2f GiB", BytesToGib(bytes));
  return text;
}

BundleSize SizeOf(const Reconstruction& model, std::span<const Track> tracks) {
  BundleSize size;
  size.num_images = static_cast<int64_t>(model.images.size());
  for (const auto& [id, image] : model.images) {
    size.num_keypoints += static_cast<int64_t>(image.points2D.size());
  }
  double num_pairs = 0;
  for (const Track& track : tracks) {
    int64_t num_used = 0;
    for (const TrackElement& element : track) num_used += model.images.count(element.image_id) > 0;
    if (num_used < 2) continue;
    ++size.num_points;
    size.num_observations += num_used;
    num_pairs += static_cast<double>(num_used * num_used);
  }
  if (size.num_observations > 0) {
    size.covisibility = num_pairs / static_cast<double>(size.num_observations);
  }
  return size;
}

// Where bundle adjustment meets one of its limits.
struct BundleLimits {
  int64_t bytes = 0;
  int64_t observations = 0;
};

// The most free intrinsics that a camera of the model has.
int NumFreeIntrinsics(const Reconstruction& model) {
  size_t most = 0;
  for (const auto& [id, camera] : model.cameras) most = std::max(most, camera.params.size());
  return static_cast<int>(most);
}

std::vector<Track> Select(std::span<const Track> tracks, int per_image) {
  std::vector<Track> selected;
  for (const size_t i : SelectTracks(tracks, per_image, 0)) selected.push_back(tracks[i]);
  return selected;
}

// Which limit it is.
std::string Needs(int64_t bytes, const BundleSize& size, const BundleLimits& limits) {
  if (bytes > limits.bytes) return Gib(bytes) + " needed, " + Gib(limits.bytes) + " available";
  return std::to_string(size.num_observations) + " observations, of which the solver takes " +
         std::to_string(limits.observations);
}

// What the option allows, or what the machine has left.
int64_t MemoryLimit(const ReconstructOptions& options, const MemoryUse& use) {
  if (options.max_memory_gib > 0) return GibToBytes(options.max_memory_gib);
  if (use.available < 0) return std::numeric_limits<int64_t>::max();
  return std::max<int64_t>(0, use.resident) + use.available;
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
             options.max_memory_gib > 0
                 ? "raise --reconstruct.max_memory_gib"
                 : "use a machine with more memory, or reconstruct fewer images");
  return false;
}

int64_t EstimateSceneBytes(const SceneCounts& counts) {
  // A keypoint: pixel, scale, the first one at its position; of tracks its node, element, parent
  // and next one; again in the model with the point it shows.
  constexpr int64_t kKeypoint = 16 + 4 + 4 + 4 + 8 + 4 + 4 + 16 + 8;
  // An edge in the scene, the graph, and copies of a component and of its model; in the map of
  // matches.
  constexpr int64_t kPair = 4 * sizeof(ViewEdge) + 96;
  return counts.num_keypoints * kKeypoint + counts.num_pairs * kPair +
         counts.num_matches * static_cast<int64_t>(sizeof(FeatureMatch));
}

bool FitTracksToMemory(StageContext& context, const Reconstruction& model,
                       std::vector<Track>& tracks) {
  ModelStage stage(context, "memory");
  const BundleAdjustmentOptions& options = context.settings.bundle_adjustment;
  const MemoryUse use = ReadMemoryUse();
  const int64_t resident = std::max<int64_t>(0, use.resident);
  const BundleLimits limits{MemoryLimit(context.settings.reconstruct, use),
                            MaxBundleObservations(NumFreeIntrinsics(model))};
  const auto estimate = [&](std::span<const Track> of) {
    return resident + EstimateBundleBytes(options, SizeOf(model, of));
  };
  const auto fits = [&](std::span<const Track> of) {
    return estimate(of) <= limits.bytes &&
           SizeOf(model, of).num_observations <= limits.observations;
  };
  const int64_t wanted = estimate(tracks);
  stage.Add("tracks_in", tracks.size());
  stage.Add("resident_gib", BytesToGib(resident));
  stage.Add("estimated_peak_gib", BytesToGib(wanted));
  if (limits.bytes < std::numeric_limits<int64_t>::max()) {
    stage.Add("limit_gib", BytesToGib(limits.bytes));
  }
  stage.Note("triangulation and bundle adjustment of " + std::to_string(model.images.size()) +
             " images and " + std::to_string(tracks.size()) + " tracks: predicted peak memory " +
             Gib(wanted) + ", " + Gib(resident) + " in use now");
  if (!fits(tracks)) {
    // The most tracks an image that fit, by bisection.
    int too_many = 1 << 20, enough = kMinTracksPerImage;
    std::vector<Track> fitting = Select(tracks, enough);
    if (!fits(fitting)) {
      stage.Fail("even with " + std::to_string(kMinTracksPerImage) + " tracks an image, " +
                     Needs(estimate(fitting), SizeOf(model, fitting), limits),
                 context.settings.reconstruct.max_memory_gib > 0
                     ? "raise --reconstruct.max_memory_gib"
                     : "use a machine with more memory, or reconstruct fewer images");
      return false;
    }
    while (too_many - enough > std::max(1, enough / 20)) {
      const int middle = enough + (too_many - enough) / 2;
      std::vector<Track> candidate = Select(tracks, middle);
      if (fits(candidate)) {
        enough = middle;
        fitting = std::move(candidate);
      } else {
        too_many = middle;
      }
    }
    stage.Warn(Needs(wanted, SizeOf(model, tracks), limits) + ": " +
               std::to_string(fitting.size()) + " of " + std::to_string(tracks.size()) +
               " tracks are used, at least " + std::to_string(enough) + " an image");
    tracks = std::move(fitting);
    stage.Add("reduced_peak_gib", BytesToGib(estimate(tracks)));
  }
  stage.Add("tracks_out", tracks.size());
  return true;
}

}  // namespace cairn
