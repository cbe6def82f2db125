#include "cairn/scene/reconstruction.h"

#include <limits>
#include <utility>

#include "cairn/base/check.h"
#include "cairn/base/parallel.h"
#include "scene/view_table.h"

namespace cairn {
namespace {

// By point, the mean reprojection error of its observations, -1 without any.
std::vector<double> PointErrorsPx(const Reconstruction& model, int num_threads) {
  const ViewTable views(model);
  std::vector<const Point3D*> points;
  for (const auto& [id, point] : model.points3D) points.push_back(&point);
  std::vector<double> errors(points.size());
  ParallelFor(
      num_threads, std::ssize(points),
      [&](int64_t i) {
        if (points[i]->track.empty()) {
          errors[i] = -1;
          return;
        }
        for (const TrackElement& element : points[i]->track) {
          errors[i] += views.Of(element.image_id).ErrorPx(points[i]->xyz, element.point2D);
        }
        errors[i] /= static_cast<double>(points[i]->track.size());
      },
      /*grain=*/256);
  return errors;
}

}  // namespace

double ReprojectionErrorPx(const Camera& camera, const Rigid3d& cam_from_world,
                           const Eigen::Vector3d& xyz, const Eigen::Vector2d& pixel) {
  const auto projected = camera.ImgFromRay(cam_from_world * xyz);
  if (!projected) return std::numeric_limits<double>::infinity();
  return PixelDifference({camera.model, camera.params.data()}, *projected, pixel).norm();
}

point3D_t Reconstruction::AddPoint3D(Point3D point) {
  std::vector<Point3D> points;  // (a list of initializers would copy it)
  points.push_back(std::move(point));
  AddPoints3D(std::move(points));
  return points3D.rbegin()->first;
}

void Reconstruction::AddPoints3D(std::vector<Point3D> points, int num_threads) {
  const point3D_t first = points3D.empty() ? 1 : points3D.rbegin()->first + 1;
  ParallelFor(
      num_threads, std::ssize(points),
      [&](int64_t i) {
        for (const TrackElement& element : points[i].track) {
          point3D_t& shown = images.at(element.image_id).point3D_ids.at(element.point2D);
          CAIRN_CHECK_EQ(shown, kInvalidPoint3DId);
          shown = first + i;
        }
      },
      /*grain=*/1024);
  point3D_t id = first;
  for (Point3D& point : points) points3D.emplace_hint(points3D.end(), id++, std::move(point));
}

void Reconstruction::RemovePoint3D(point3D_t id) {
  const auto it = points3D.find(id);
  CAIRN_CHECK(it != points3D.end());
  for (const TrackElement& element : it->second.track) {
    images.at(element.image_id).point3D_ids.at(element.point2D) = kInvalidPoint3DId;
  }
  points3D.erase(it);
}

void Reconstruction::RemoveObservation(point3D_t id, const TrackElement& element) {
  Point3D& point = points3D.at(id);
  if (point.track.size() <= 2) {
    RemovePoint3D(id);
    return;
  }
  CAIRN_CHECK_EQ(std::erase(point.track, element), size_t{1});
  images.at(element.image_id).point3D_ids.at(element.point2D) = kInvalidPoint3DId;
}

int64_t Reconstruction::NumObservations() const {
  int64_t n = 0;
  for (const auto& [id, point] : points3D) n += static_cast<int64_t>(point.track.size());
  return n;
}

double Reconstruction::MeanTrackLength() const {
  return points3D.empty()
             ? 0.0
             : static_cast<double>(NumObservations()) / static_cast<double>(points3D.size());
}

double Reconstruction::MeanReprojectionErrorPx(int num_threads) const {
  double sum = 0;
  int64_t n = 0;
  for (const double error : PointErrorsPx(*this, num_threads)) {
    if (error < 0 || error == std::numeric_limits<double>::infinity()) continue;
    sum += error;
    ++n;
  }
  if (n == 0) return points3D.empty() ? 0.0 : std::numeric_limits<double>::infinity();
  return sum / static_cast<double>(n);
}

void Reconstruction::UpdatePointErrors(int num_threads) {
  size_t next = 0;
  const std::vector<double> errors = PointErrorsPx(*this, num_threads);
  for (auto& [id, point] : points3D) point.error_px = errors[next++];
}

void Reconstruction::Transform(const Sim3d& new_from_old_world) {
  for (auto& [id, image] : images) {
    image.cam_from_world = TransformCameraWorld(new_from_old_world, image.cam_from_world);
  }
  for (auto& [id, point] : points3D) point.xyz = new_from_old_world * point.xyz;
}

}  // namespace cairn
