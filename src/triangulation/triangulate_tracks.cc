#include "cairn/triangulation/triangulate_tracks.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "cairn/base/parallel.h"
#include "scene/view_table.h"

namespace cairn {
namespace {

// Cameras, poses and undistorted rays of the registered images, ready for the inner loop.
struct PreparedImage {
  const RegisteredImage* image = nullptr;
  TriangulationView pose;  // without a ray
  // NaN: this keypoint is not in a track, or the distortion cannot be undone there.
  std::vector<Eigen::Vector2d> rays;
  std::vector<float> focals_px;  // of the image there
  // Where the camera is not planar: every keypoint has a camera of its own, turned so that the
  // bearing is its axis. Its ray is (0, 0).
  std::vector<Eigen::Matrix3d> own_from_cam;

  TriangulationView View(point2D_t k) const {
    TriangulationView view = pose;
    view.ray = rays[k];
    view.focal_px = focals_px[k];
    if (!own_from_cam.empty()) {
      view.cam_from_world_rotation = own_from_cam[k] * pose.cam_from_world_rotation;
      view.cam_from_world_translation = own_from_cam[k] * pose.cam_from_world_translation;
    }
    return view;
  }
};

// Pixels a unit of a planar camera's rays. Where a wide lens squeezes the corners, an error of a
// pixel is many of the undistorted image; ordinary lenses hardly tell these apart.
double FocalAt(const Camera& camera, const Eigen::Matrix2d& ray_by_pixel) {
  constexpr double kMinSqueeze = 1.5;
  const double mean_px = camera.MeanFocal();
  const double focal_px = 1.0 / std::sqrt(std::abs(ray_by_pixel.determinant()));
  return mean_px > kMinSqueeze * focal_px ? focal_px : mean_px;
}

void UndistortRays(const Camera& camera, PreparedImage* p) {
  const bool is_planar = camera.IsPlanar();
  p->focals_px.resize(p->rays.size());
  if (!is_planar) p->own_from_cam.resize(p->rays.size());
  for (size_t k = 0; k < p->rays.size(); ++k) {
    if (std::isnan(p->rays[k].x())) continue;
    const Eigen::Vector2d& pixel = p->image->points2D[k];
    if (is_planar) {
      Eigen::Matrix2d ray_by_pixel = Eigen::Matrix2d::Identity();
      p->rays[k] =
          camera.CamFromImg(pixel, &ray_by_pixel).value_or(Eigen::Vector2d::Constant(std::nan("")));
      p->focals_px[k] = FocalAt(camera, ray_by_pixel);
      continue;
    }
    const auto bearing = camera.RayFromImg(pixel);
    const double radians_per_px = bearing ? camera.RadiansPerPx(*bearing) : 0.0;
    if (!(radians_per_px > 0.0) || !std::isfinite(radians_per_px)) {
      p->rays[k].setConstant(std::nan(""));
      continue;
    }
    const Eigen::Vector3d across = bearing->unitOrthogonal();
    p->own_from_cam[k] << across.transpose(), bearing->cross(across).transpose(),
        bearing->transpose();
    p->focals_px[k] = 1.0 / radians_per_px;
  }
}

std::unordered_map<image_t, PreparedImage> PrepareImages(std::span<const Track> tracks,
                                                         int num_threads,
                                                         const Reconstruction& reconstruction) {
  std::unordered_map<image_t, PreparedImage> prepared;
  for (const auto& [image_id, image] : reconstruction.images) {
    PreparedImage& p = prepared[image_id];
    p.image = &image;
    p.pose.cam_from_world_rotation = image.cam_from_world.RotationMatrix();
    p.pose.cam_from_world_translation = image.cam_from_world.translation;
    p.pose.error_scale = reconstruction.CameraOf(image).ErrorScale();
    p.rays.assign(image.points2D.size(), Eigen::Vector2d::Constant(std::nan("")));
  }
  // Zero marks the keypoints that are needed.
  for (const Track& track : tracks) {
    for (const TrackElement& element : track) {
      const auto it = prepared.find(element.image_id);
      if (it != prepared.end()) it->second.rays.at(element.point2D).setZero();
    }
  }
  std::vector<PreparedImage*> list;
  for (auto& [image_id, p] : prepared) list.push_back(&p);
  ParallelFor(num_threads, static_cast<int64_t>(list.size()),
              [&](int64_t i) { UndistortRays(reconstruction.CameraOf(*list[i]->image), list[i]); });
  return prepared;
}

// What one track gave: a point, and perhaps a second one from the observations left over.
struct TrackOutcome {
  TriangulationStatus status = TriangulationStatus::kTooFewViews;
  bool has_two_views = false;
  std::vector<Point3D> points;
};

TrackOutcome TriangulateTrack(const Track& track, const TriangulationOptions& options,
                              const std::unordered_map<image_t, PreparedImage>& prepared) {
  TrackOutcome outcome;
  Track elements;
  std::vector<TriangulationView> views;
  for (const TrackElement& element : track) {
    const auto it = prepared.find(element.image_id);
    if (it == prepared.end()) continue;
    if (std::isnan(it->second.rays[element.point2D].x())) continue;
    elements.push_back(element);
    views.push_back(it->second.View(element.point2D));
    const std::vector<float>& sigmas_px = it->second.image->sigmas_px;
    if (!sigmas_px.empty()) views.back().sigma_px = sigmas_px[element.point2D];
  }
  outcome.has_two_views = views.size() >= 2;
  // The second round looks at what the first point left over.
  for (int round = 0; round < 2 && views.size() >= 2; ++round) {
    const TriangulationResult result = Triangulate(views, options);
    if (round == 0) outcome.status = result.status;
    if (result.status != TriangulationStatus::kSuccess) break;
    Point3D point;
    point.xyz = result.xyz;
    point.error_px = result.mean_error_px;
    for (const int i : result.inliers) point.track.push_back(elements[i]);
    outcome.points.push_back(std::move(point));
    for (auto it = result.inliers.rbegin(); it != result.inliers.rend(); ++it) {
      elements.erase(elements.begin() + *it);
      views.erase(views.begin() + *it);
    }
  }
  return outcome;
}

// What the filter does with a point.
struct Verdict {
  bool keep = false;
  Track bad;  // observations to remove from a point that is kept
};

Verdict Judge(const Point3D& point, const ViewTable& views,
              const std::vector<Eigen::Vector3d>& centers, const TriangulationOptions& options) {
  Verdict verdict;
  std::vector<Eigen::Vector3d> good_centers;
  for (const TrackElement& element : point.track) {
    const ViewTable::View& view = views.Of(element.image_id);
    const double error_px = view.ErrorPx(point.xyz, element.point2D);
    double max_error_px = options.max_error_px * view.camera->ErrorScale();
    if (!view.image->sigmas_px.empty()) {
      max_error_px =
          std::min(max_error_px, options.max_error_sigmas * view.image->sigmas_px[element.point2D]);
    }
    if (error_px <= max_error_px) {
      good_centers.push_back(centers[view.index]);
    } else {
      verdict.bad.push_back(element);
    }
  }
  if (static_cast<int>(good_centers.size()) < options.min_views) return verdict;
  verdict.keep = MaxTriangulationAngleDeg(point.xyz, std::move(good_centers),
                                          options.min_angle_deg) >= options.min_angle_deg;
  return verdict;
}

}  // namespace

TriangulateTracksReport TriangulateTracks(std::span<const Track> tracks,
                                          Reconstruction& reconstruction,
                                          const TriangulationOptions& options,
                                          const RunContext& run) {
  ValidateOptions(options, "triangulation");
  for (auto& [image_id, image] : reconstruction.images) {
    std::fill(image.point3D_ids.begin(), image.point3D_ids.end(), kInvalidPoint3DId);
  }
  reconstruction.points3D.clear();
  const std::unordered_map<image_t, PreparedImage> prepared =
      PrepareImages(tracks, run.num_threads, reconstruction);
  std::vector<TrackOutcome> outcomes(tracks.size());
  ParallelFor(
      run.num_threads, static_cast<int64_t>(tracks.size()),
      [&](int64_t i) { outcomes[i] = TriangulateTrack(tracks[i], options, prepared); }, 64);

  TriangulateTracksReport report;
  std::vector<Point3D> points;
  for (TrackOutcome& outcome : outcomes) {
    if (!outcome.has_two_views) continue;
    ++report.num_tracks;
    report.num_small_angle += outcome.status == TriangulationStatus::kSmallAngle;
    report.num_inconsistent += outcome.status == TriangulationStatus::kTooFewViews ||
                               outcome.status == TriangulationStatus::kIllPosed;
    for (Point3D& point : outcome.points) {
      report.num_observations += std::ssize(point.track);
      points.push_back(std::move(point));
    }
  }
  report.num_points = std::ssize(points);
  reconstruction.AddPoints3D(std::move(points), run.num_threads);
  return report;
}

FilterReport FilterPoints(Reconstruction& reconstruction, const TriangulationOptions& options,
                          const RunContext& run) {
  ValidateOptions(options, "triangulation");
  const ViewTable views(reconstruction);
  std::vector<Eigen::Vector3d> centers;
  for (const auto& [image_id, image] : reconstruction.images) {
    centers.push_back(image.cam_from_world.Center());
  }
  std::vector<point3D_t> ids;
  std::vector<const Point3D*> points;
  for (const auto& [id, point] : reconstruction.points3D) {
    ids.push_back(id);
    points.push_back(&point);
  }
  std::vector<Verdict> verdicts(points.size());
  ParallelFor(
      run.num_threads, static_cast<int64_t>(points.size()),
      [&](int64_t i) { verdicts[i] = Judge(*points[i], views, centers, options); }, 64);

  FilterReport report;
  for (size_t i = 0; i < ids.size(); ++i) {
    report.num_observations_removed += static_cast<int64_t>(verdicts[i].bad.size());
    if (!verdicts[i].keep) {
      reconstruction.RemovePoint3D(ids[i]);
      ++report.num_points_removed;
      continue;
    }
    for (const TrackElement& element : verdicts[i].bad) {
      reconstruction.RemoveObservation(ids[i], element);
    }
  }
  return report;
}

}  // namespace cairn
