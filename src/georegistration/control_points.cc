#include "georegistration/control_points.h"

#include <algorithm>

#include "cairn/triangulation/triangulate_tracks.h"

namespace cairn {

std::optional<LocatedPoint> LocatePoint(const Reconstruction& model,
                                        const std::map<std::string, image_t>& ids,
                                        const ControlPoint& point) {
  Reconstruction views;  // the images that show it, with it as their only keypoint
  Track track;
  for (const auto& [name, pixel] : point.pixels) {
    const auto id = ids.find(name);
    if (id == ids.end()) continue;
    const RegisteredImage& image = model.images.at(id->second);
    views.cameras[image.image.camera_id] = model.CameraOf(image);
    views.images[id->second] = {image.image, image.cam_from_world, {pixel}, {kInvalidPoint3DId}};
    track.push_back({id->second, 0});
  }
  if (track.size() < 2) return std::nullopt;
  std::sort(track.begin(), track.end());
  TriangulateTracks({&track, 1}, views, {}, {.num_threads = 1});
  if (views.points3D.empty()) return std::nullopt;
  const Point3D& found = views.points3D.begin()->second;
  LocatedPoint located{found.xyz, {}};
  for (const TrackElement& element : found.track) {
    located.pixels[element.image_id] = views.images.at(element.image_id).points2D[0];
  }
  return located;
}

}  // namespace cairn
