#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <iterator>
#include <map>
#include <vector>

#include "cairn/base/types.h"
#include "cairn/camera/camera.h"
#include "cairn/geometry/rigid3d.h"
#include "cairn/scene/features.h"
#include "cairn/scene/image.h"

namespace cairn {

// One keypoint of one image.
struct TrackElement {
  image_t image_id = kInvalidImageId;
  point2D_t point2D = kInvalidPoint2D;
  auto operator<=>(const TrackElement&) const = default;
};

// Keypoints that show the same scene point, sorted and distinct. cairn makes tracks with at most
// one an image; models of others may have several.
using Track = std::vector<TrackElement>;

struct Point3D {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  std::array<uint8_t, 3> color = {0, 0, 0};  // RGB
  double error_px = -1;                      // mean reprojection error, -1 if not computed
  Track track;
};

// A photograph with a pose, and for each of its keypoints the 3D point it shows.
struct RegisteredImage {
  Image image;
  Rigid3d cam_from_world;
  std::vector<Eigen::Vector2d> points2D;  // pixels
  std::vector<point3D_t> point3D_ids;     // kInvalidPoint3DId: none; same size as points2D
  // Standard deviation of each keypoint's position, pixels; empty: not known, 1 is assumed.
  std::vector<float> sigmas_px = {};

  // Of the keypoints, those that show a point.
  int64_t NumPoints() const {
    return std::ssize(point3D_ids) - std::ranges::count(point3D_ids, kInvalidPoint3DId);
  }
};

// Cameras, registered images and 3D points. Ordered maps: every loop runs in the order of the ids.
struct Reconstruction {
  std::map<camera_t, Camera> cameras;
  std::map<image_t, RegisteredImage> images;
  std::map<point3D_t, Point3D> points3D;

  const Camera& CameraOf(const RegisteredImage& image) const {
    return cameras.at(image.image.camera_id);
  }

  // Adds a point with a new id, and sets the references of its track's images to it. The track's
  // keypoints must not show another point.
  point3D_t AddPoint3D(Point3D point);
  // Adds many, with ascending new ids.
  void AddPoints3D(std::vector<Point3D> points, int num_threads = 1);
  // Removes a point and every reference to it.
  void RemovePoint3D(point3D_t id);
  // Removes one observation; the whole point if fewer than two would remain.
  void RemoveObservation(point3D_t id, const TrackElement& element);

  int64_t NumObservations() const;
  double MeanTrackLength() const;
  // Mean over the points of their mean reprojection errors, as COLMAP's model_analyzer states it;
  // points that one of their cameras does not have in front are left out.
  double MeanReprojectionErrorPx(int num_threads = 1) const;
  // Recomputes error_px of every point: infinite if one camera does not have it in front.
  void UpdatePointErrors(int num_threads = 1);
  // Applies new_from_old_world to every pose and point.
  void Transform(const Sim3d& new_from_old_world);
};

// Reprojection error in pixels; infinite when the point is not in front of the camera.
double ReprojectionErrorPx(const Camera& camera, const Rigid3d& cam_from_world,
                           const Eigen::Vector3d& xyz, const Eigen::Vector2d& pixel);

}  // namespace cairn
