#include "base/memory.h"

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

std::vector<Track> Select(std::span<const Track> tracks, int per_image) {
  std::vector<Track> selected;
  for (const size_t i : SelectTracks(tracks, per_image, 0)) selected.push_back(tracks[i]);
  return selected;
}

}  // namespace

bool FitTracksToMemory(StageContext& context, const Reconstruction& model,
                       std::vector<Track>& tracks) {
  ModelStage stage(context, "memory");
  const BundleAdjustmentOptions& options = context.settings.bundle_adjustment;
  const double limit_gib = context.settings.reconstruct.max_memory_gib;
  const MemoryUse use = ReadMemoryUse();
  const int64_t resident = std::max<int64_t>(0, use.resident);
  int64_t limit = std::numeric_limits<int64_t>::max();
  if (limit_gib > 0) {
    limit = GibToBytes(limit_gib);
  } else if (use.available >= 0) {
    limit = resident + use.available;
  }
  const auto estimate = [&](std::span<const Track> of) {
    return resident + EstimateBundleBytes(options, SizeOf(model, of));
  };
  const int64_t wanted = estimate(tracks);
  stage.Add("tracks_in", tracks.size());
  stage.Add("resident_gib", BytesToGib(resident));
  stage.Add("estimated_peak_gib", BytesToGib(wanted));
  if (limit < std::numeric_limits<int64_t>::max()) stage.Add("limit_gib", BytesToGib(limit));
  stage.Note("triangulation and bundle adjustment of " + std::to_string(model.images.size()) +
             " images and " + std::to_string(tracks.size()) + " tracks: predicted peak memory " +
             Gib(wanted) + ", " + Gib(resident) + " in use now");
  if (wanted > limit) {
    // The most tracks an image that fit, by bisection.
    int too_many = 1 << 20, enough = kMinTracksPerImage;
    std::vector<Track> fitting = Select(tracks, enough);
    if (const int64_t least = estimate(fitting); least > limit) {
      stage.Fail("even with " + std::to_string(kMinTracksPerImage) + " tracks an image, " +
                     Gib(least) + " needed, " + Gib(limit) + " available",
                 limit_gib > 0 ? "raise --reconstruct.max_memory_gib"
                               : "use a machine with more memory, or reconstruct fewer images");
      return false;
    }
    while (too_many - enough > std::max(1, enough / 20)) {
      const int middle = enough + (too_many - enough) / 2;
      std::vector<Track> candidate = Select(tracks, middle);
      if (estimate(candidate) > limit) {
        too_many = middle;
      } else {
        enough = middle;
        fitting = std::move(candidate);
      }
    }
    stage.Warn(Gib(wanted) + " needed, " + Gib(limit) + " available: " +
               std::to_string(fitting.size()) + " of " + std::to_string(tracks.size()) +
               " tracks are used, at least " + std::to_string(enough) + " an image");
    tracks = std::move(fitting);
    stage.Add("reduced_peak_gib", BytesToGib(estimate(tracks)));
  }
  stage.Add("tracks_out", tracks.size());
  return true;
}

}  // namespace cairn
