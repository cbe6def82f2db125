#include <algorithm>

#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"
#include "cairn/math/median.h"
#include "mapper/stages.h"

namespace cairn {
namespace {

// Between the first ray of a track and another one, radians; 0: fewer than two rays.
double WidestAngle(const Track& track, const Reconstruction& model) {
  std::optional<Eigen::Vector3d> first;
  double widest = 0;
  for (const TrackElement& element : track) {
    const auto entry = model.images.find(element.image_id);
    if (entry == model.images.end()) continue;
    const RegisteredImage& image = entry->second;
    const auto ray = model.CameraOf(image).RayFromImg(image.points2D[element.point2D]);
    if (!ray) continue;
    const Eigen::Vector3d world = image.cam_from_world.rotation.conjugate() * *ray;
    if (!first) first = world;
    widest = std::max(widest, AngleBetween(*first, world));
  }
  return widest;
}

// Under which a pixel's error moves a point by a quarter of its distance.
double IndistinctAngle(const Reconstruction& model) {
  std::vector<double> focals;
  for (const auto& [id, camera] : model.cameras) focals.push_back(camera.MeanFocal());
  return kMinParallaxPx / UpperMedian(focals);
}

}  // namespace

TrackAngles FindTrackAngles(const StageContext& context, std::span<const Track> tracks,
                            const Reconstruction& model) {
  TrackAngles angles{context.settings.triangulation.min_angle_deg, false, {}};
  angles.of_tracks_deg.resize(tracks.size());
  ParallelFor(
      context.run.num_threads, std::ssize(tracks),
      [&](int64_t i) { angles.of_tracks_deg[i] = RadToDeg(WidestAngle(tracks[i], model)); }, 256);
  if (tracks.empty()) return angles;
  const double median_deg = UpperMedian(angles.of_tracks_deg);
  const double indistinct_deg = RadToDeg(IndistinctAngle(model));
  angles.are_mostly_none = median_deg < indistinct_deg;
  if (median_deg < angles.min_deg) {
    angles.min_deg = std::min(angles.min_deg, std::max(0.5 * median_deg, indistinct_deg));
  }
  return angles;
}

}  // namespace cairn
