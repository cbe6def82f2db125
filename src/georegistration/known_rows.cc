#include "georegistration/known_rows.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "cairn/evaluation/error_statistics.h"
#include "cairn/triangulation/triangulate_tracks.h"

namespace cairn {
namespace {

GpsPosition MedianPosition(const std::vector<GpsPosition>& positions) {
  std::vector<double> latitudes, longitudes, altitudes;
  for (const GpsPosition& position : positions) {
    latitudes.push_back(position.latitude_deg);
    // Without a jump at the 180th meridian.
    const double from_first_deg = position.longitude_deg - positions[0].longitude_deg;
    longitudes.push_back(position.longitude_deg - 360 * std::round(from_first_deg / 360));
    if (position.altitude_m) altitudes.push_back(*position.altitude_m);
  }
  GpsPosition middle;
  if (positions.empty()) return middle;
  middle = {Median(std::move(latitudes)), std::remainder(Median(std::move(longitudes)), 360)};
  if (!altitudes.empty()) middle.altitude_m = Median(std::move(altitudes));
  return middle;
}

// Do the altitudes of the model's images decide its heights? Where fewer than half of the positions
// have one, all horizontal positions tell more; and it takes three.
bool UsesAltitudes(const Reconstruction& model, const std::map<std::string, GpsRow>& rows) {
  int num_with = 0, num_without = 0;
  for (const auto& [id, image] : model.images) {
    const auto row = rows.find(image.image.name);
    if (row != rows.end()) ++(row->second.position.altitude_m ? num_with : num_without);
  }
  return num_without == 0 || (num_with >= 3 && num_with >= num_without);
}

// Where the model has a control point.
struct LocatedPoint {
  Eigen::Vector3d in_model;
  std::map<image_t, Eigen::Vector2d> pixels;  // of the images that agree
};

// Triangulated from its measurements (with the usual thresholds); nullopt: no image of the model
// shows it, or `out` says what is wrong with it.
std::optional<LocatedPoint> LocatePoint(const Reconstruction& model,
                                        const std::map<std::string, image_t>& ids,
                                        const ControlPoint& point, Georegistration& out) {
  Reconstruction views;  // the images that show it, with it as their only keypoint
  Track track;
  for (const auto& [name, pixel] : point.pixels) {
    const auto id = ids.find(name);
    if (id == ids.end()) continue;
    const RegisteredImage& image = model.images.at(id->second);
    const Camera& camera = model.CameraOf(image);
    if (!(pixel.minCoeff() >= 0 && pixel.x() <= camera.width && pixel.y() <= camera.height)) {
      out.outside.push_back(point.name + " in " + name);
      continue;
    }
    views.cameras[image.image.camera_id] = camera;
    views.images[id->second] = {image.image, image.cam_from_world, {pixel}, {kInvalidPoint3DId}};
    track.push_back({id->second, 0});
  }
  if (track.size() == 1) out.shown_once.push_back(point.name);
  if (track.size() < 2) return std::nullopt;
  std::sort(track.begin(), track.end());
  TriangulateTracks({&track, 1}, views, {}, {.num_threads = 1});
  if (views.points3D.empty()) {
    out.unlocated.push_back(point.name);
    return std::nullopt;
  }
  const Point3D& found = views.points3D.begin()->second;
  LocatedPoint located{found.xyz, {}};
  for (const TrackElement& element : found.track) {
    located.pixels[element.image_id] = views.images.at(element.image_id).points2D[0];
  }
  return located;
}

}  // namespace

GpsPosition OriginOf(const KnownPositions& known) {
  std::vector<GpsPosition> images, points;
  for (const auto& [name, row] : known.images) images.push_back(row.position);
  for (const ControlPoint& point : known.control_points) {
    if (!point.is_check) points.push_back(point.position);
  }
  return MedianPosition(points.size() < 3 && !images.empty() ? images : points);
}

Rows FindImages(const Reconstruction& model, const std::map<std::string, GpsRow>& rows,
                const LocalFrame& frame, Georegistration& out) {
  std::vector<double> given;
  for (const auto& [name, row] : rows) {
    if (row.sigma_m > 0) given.push_back(row.sigma_m);
  }
  const double usual = given.empty() ? 1.0 : Median(given);
  const bool uses_altitudes = UsesAltitudes(model, rows);
  Rows found_rows;
  for (const auto& [id, image] : model.images) {
    const auto row = rows.find(image.image.name);
    if (row == rows.end()) continue;
    auto [position, sigma_m] = row->second;
    if (uses_altitudes && !position.altitude_m) {
      out.without_altitude.push_back(image.image.name);
      continue;
    }
    if (!uses_altitudes && position.altitude_m) out.unused_altitudes.push_back(image.image.name);
    if (!uses_altitudes) position.altitude_m.reset();
    GeoregisteredImage& found = out.images.emplace_back();
    found.image_id = id;
    found.name = image.image.name;
    found.gps = position;
    found.gps_enu =
        frame.FromGps({position.latitude_deg, position.longitude_deg,
                       uses_altitudes ? position.altitude_m : frame.origin().altitude_m});
    found.is_sigma_given = sigma_m > 0;
    found.sigma_m = found.is_sigma_given ? sigma_m : usual;
    found_rows.push_back({image.cam_from_world.Center(), found.gps_enu, found.sigma_m,
                          uses_altitudes, std::max(sigma_m, 0.0)});
  }
  return found_rows;
}

Rows FindPoints(const Reconstruction& model, const std::vector<ControlPoint>& points,
                const LocalFrame& frame, Georegistration& out) {
  std::map<std::string, image_t> ids;
  for (const auto& [id, image] : model.images) ids[image.image.name] = id;
  Rows rows;
  for (const ControlPoint& point : points) {
    const auto located = LocatePoint(model, ids, point, out);
    if (!located) continue;
    GeoregisteredPoint& found = out.points.emplace_back();
    found.name = point.name;
    found.position = point.position;
    found.enu = frame.FromGps(point.position);
    found.pixels = located->pixels;
    found.is_check = point.is_check;
    rows.push_back({located->in_model, found.enu, kControlPointSigmaM});
  }
  return rows;
}

}  // namespace cairn
