#include "cairn/scene/reconstruction.h"

#include <algorithm>
#include <limits>

#include "cairn/base/check.h"

namespace cairn {

double ReprojectionErrorPx(const Camera& camera, const Rigid3d& cam_from_world,
                           const Eigen::Vector3d& xyz, const Eigen::Vector2d& pixel) {
  const auto projected = camera.ImgFromRay(cam_from_world * xyz);
  return projected ? (*projected - pixel).norm() : std::numeric_limits<double>::infinity();
}

point3D_t Reconstruction::AddPoint3D(const Point3D& point) {
  const point3D_t id = points3D.empty() ? 1 : points3D.rbegin()->first + 1;
  for (const TrackElement& element : point.track) {
    CAIRN_CHECK_EQ(images.at(element.image_id).point3D_ids.at(element.point2D), kInvalidPoint3DId);
  }
  for (const TrackElement& element : point.track) {
    images.at(element.image_id).point3D_ids[element.point2D] = id;
  }
  points3D.emplace(id, point);
  return id;
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

double Reconstruction::PointErrorPx(const Point3D& point) const {
  double sum = 0;
  for (const TrackElement& element : point.track) {
    const RegisteredImage& image = images.at(element.image_id);
    sum += ReprojectionErrorPx(CameraOf(image), image.cam_from_world, point.xyz,
                               image.points2D[element.point2D]);
  }
  return sum / static_cast<double>(point.track.size());
}

double Reconstruction::MeanReprojectionErrorPx() const {
  double sum = 0;
  int64_t n = 0;
  for (const auto& [id, point] : points3D) {
    const double error = PointErrorPx(point);
    if (error == std::numeric_limits<double>::infinity()) continue;
    sum += error;
    ++n;
  }
  return n == 0 ? 0.0 : sum / static_cast<double>(n);
}

void Reconstruction::UpdatePointErrors() {
  for (auto& [id, point] : points3D) point.error_px = PointErrorPx(point);
}

void Reconstruction::Transform(const Sim3d& new_from_old_world) {
  for (auto& [id, image] : images) {
    image.cam_from_world = TransformCameraWorld(new_from_old_world, image.cam_from_world);
  }
  for (auto& [id, point] : points3D) point.xyz = new_from_old_world * point.xyz;
}

void Reconstruction::CheckConsistency() const {
  for (const auto& [id, image] : images) {
    CAIRN_CHECK_EQ(id, image.image.image_id);
    CAIRN_CHECK(cameras.count(image.image.camera_id) == 1);
    CAIRN_CHECK_EQ(image.points2D.size(), image.point3D_ids.size());
    CAIRN_CHECK(image.cam_from_world.translation.allFinite());
    CAIRN_CHECK(image.cam_from_world.rotation.coeffs().allFinite());
    for (size_t i = 0; i < image.point3D_ids.size(); ++i) {
      if (image.point3D_ids[i] == kInvalidPoint3DId) continue;
      const Track& track = points3D.at(image.point3D_ids[i]).track;
      const TrackElement element{id, static_cast<point2D_t>(i)};
      CAIRN_CHECK(std::find(track.begin(), track.end(), element) != track.end());
    }
  }
  for (const auto& [id, point] : points3D) {
    CAIRN_CHECK(point.xyz.allFinite());
    CAIRN_CHECK_GE(point.track.size(), size_t{2});
    for (size_t i = 1; i < point.track.size(); ++i) {
      CAIRN_CHECK(point.track[i - 1] < point.track[i]);
    }
    for (const TrackElement& element : point.track) {
      CAIRN_CHECK_EQ(images.at(element.image_id).point3D_ids.at(element.point2D), id);
    }
  }
}

}  // namespace cairn
