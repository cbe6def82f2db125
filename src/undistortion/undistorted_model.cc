#include "cairn/image/resample.h"
#include "cairn/undistortion/undistort.h"

namespace cairn {
namespace {

// The image without keypoints that have no undistorted pixel; none shows a point yet. Fills the new
// index of each keypoint (kInvalidPoint2D: left out).
RegisteredImage UndistortedImage(const RegisteredImage& image, const Camera& source,
                                 const Camera& target, std::vector<point2D_t>& new_index) {
  RegisteredImage out;
  out.image = image.image;
  out.cam_from_world = image.cam_from_world;
  new_index.assign(image.points2D.size(), kInvalidPoint2D);
  for (size_t i = 0; i < image.points2D.size(); ++i) {
    const auto pixel = ResamplePixel(image.points2D[i], source, target);
    if (!pixel) continue;
    new_index[i] = static_cast<point2D_t>(out.points2D.size());
    out.points2D.push_back(*pixel);
  }
  out.point3D_ids.assign(out.points2D.size(), kInvalidPoint3DId);
  return out;
}

}  // namespace

Reconstruction UndistortedModel(const Reconstruction& model, const std::set<std::string>& names,
                                const UndistortOptions& options, const RunContext& run) {
  Reconstruction out;
  std::map<image_t, std::vector<point2D_t>> new_index;
  for (const auto& [id, image] : model.images) {
    if (!names.contains(image.image.name)) continue;
    const Camera& source = model.CameraOf(image);
    if (!out.cameras.contains(source.camera_id)) {
      out.cameras[source.camera_id] = UndistortedCamera(source, options);
    }
    out.images[id] =
        UndistortedImage(image, source, out.cameras.at(source.camera_id), new_index[id]);
  }
  for (const auto& [id, point] : model.points3D) {
    Point3D moved = point;
    moved.track.clear();
    for (const TrackElement& element : point.track) {
      const auto indices = new_index.find(element.image_id);
      if (indices == new_index.end()) continue;
      const point2D_t index = indices->second[element.point2D];
      if (index != kInvalidPoint2D) moved.track.push_back({element.image_id, index});
    }
    if (moved.track.size() < 2) continue;
    for (const TrackElement& element : moved.track) {
      out.images.at(element.image_id).point3D_ids[element.point2D] = id;
    }
    out.points3D[id] = std::move(moved);
  }
  out.UpdatePointErrors(run.num_threads);
  return out;
}

}  // namespace cairn
