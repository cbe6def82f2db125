#include "view_graph/shared_view.h"

#include <algorithm>
#include <cmath>

#include "cairn/base/parallel.h"
#include "cairn/math/angles.h"
#include "math/sorted_order.h"

namespace cairn {
namespace {

// Cells of an image's longer side.
constexpr int kCells = 10;
// Points of an image that are looked at.
constexpr size_t kMaxPoints = 400;
// A point should look the same from the other camera: directions and distances are similar.
const double kMinCosine = std::cos(DegToRad(25.0));
constexpr double kMaxDistanceRatio = 1.6;

// Distortion models fold what lies beyond their field back into the picture: there the pixel is
// another direction's.
bool IsInField(const Camera& camera, const Eigen::Vector3d& in_camera,
               const Eigen::Vector2d& pixel) {
  if (camera.DistortionIndices().empty()) return true;
  const auto ray = camera.RayFromImg(pixel);
  return ray && AngleBetween(*ray, in_camera) < DegToRad(1.0);
}

View MakeView(const Reconstruction& model, const RegisteredImage& image) {
  View view;
  view.image = &image;
  view.camera = &model.CameraOf(image);
  view.center = image.cam_from_world.Center();
  const double cell_size =
      static_cast<double>(std::max(view.camera->width, view.camera->height)) / kCells;
  view.columns = std::max(1, static_cast<int>(std::lround(view.camera->width / cell_size)));
  view.rows = std::max(1, static_cast<int>(std::lround(view.camera->height / cell_size)));
  view.present.assign(static_cast<size_t>(view.columns) * view.rows, 0);
  view.farthest.assign(view.present.size(), 0);
  for (size_t k = 0; k < image.point3D_ids.size(); ++k) {
    const point3D_t id = image.point3D_ids[k];
    if (id == kInvalidPoint3DId) continue;
    view.seen.push_back(id);
    const int cell = view.CellOf(image.points2D[k]);
    if (cell < 0) continue;
    ++view.present[cell];
    const double distance = (model.points3D.at(id).xyz - view.center).norm();
    view.farthest[cell] = std::max(view.farthest[cell], distance);
  }
  const size_t num_samples = std::min(view.seen.size(), kMaxPoints);
  for (size_t k = 0; k < num_samples; ++k) {
    const point3D_t id = view.seen[k * view.seen.size() / num_samples];
    view.samples.emplace_back(id, model.points3D.at(id).xyz);
  }
  std::sort(view.seen.begin(), view.seen.end());
  return view;
}

}  // namespace

int View::CellOf(const Eigen::Vector2d& pixel) const {
  if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < camera->width &&
        pixel.y() < camera->height)) {
    return -1;
  }
  return static_cast<int>(pixel.y() * rows / camera->height) * columns +
         static_cast<int>(pixel.x() * columns / camera->width);
}

bool View::Sees(point3D_t id) const { return std::binary_search(seen.begin(), seen.end(), id); }

std::optional<std::pair<int, int>> Views::Find(image_t id1, image_t id2) const {
  for (const image_t id : {id1, id2}) {
    if (!std::binary_search(ids.begin(), ids.end(), id)) return std::nullopt;
  }
  return std::make_pair(IndexIn(ids, id1), IndexIn(ids, id2));
}

Views MakeViews(const Reconstruction& model, int num_threads) {
  Views all;
  for (const auto& [id, image] : model.images) all.ids.push_back(id);
  all.views.resize(all.ids.size());
  ParallelFor(num_threads, std::ssize(all.ids),
              [&](int64_t i) { all.views[i] = MakeView(model, model.images.at(all.ids[i])); });
  return all;
}

std::optional<Expected> ExpectIn(const View& b, const View& a, const Eigen::Vector3d& xyz) {
  const Eigen::Vector3d from_a = xyz - a.center;
  const Eigen::Vector3d from_b = xyz - b.center;
  const double distance_a = from_a.norm();
  const double distance_b = from_b.norm();
  if (from_a.dot(from_b) < kMinCosine * distance_a * distance_b) return std::nullopt;
  if (distance_a > kMaxDistanceRatio * distance_b) return std::nullopt;
  if (distance_b > kMaxDistanceRatio * distance_a) return std::nullopt;
  const Eigen::Vector3d in_b = b.image->cam_from_world * xyz;
  const auto pixel = b.camera->ImgFromRay(in_b);
  if (!pixel) return std::nullopt;
  const int cell = b.CellOf(*pixel);
  if (cell < 0 || !IsInField(*b.camera, in_b, *pixel)) return std::nullopt;
  return Expected{cell, distance_b};
}

}  // namespace cairn
