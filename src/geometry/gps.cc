#include "cairn/geometry/gps.h"

#include <cmath>

#include "cairn/math/angles.h"

namespace cairn {
namespace {

// WGS84.
constexpr double kSemiMajorM = 6378137.0;
constexpr double kFlattening = 1 / 298.257223563;

}  // namespace

Eigen::Vector3d EarthCentered(const GpsPosition& position) {
  const double latitude = DegToRad(position.latitude_deg);
  const double longitude = DegToRad(position.longitude_deg);
  const double squared_eccentricity = kFlattening * (2 - kFlattening);
  const double sine = std::sin(latitude);
  const double normal = kSemiMajorM / std::sqrt(1 - squared_eccentricity * sine * sine);
  const double altitude_m = position.altitude_m.value_or(0);
  const double across = (normal + altitude_m) * std::cos(latitude);
  return {across * std::cos(longitude), across * std::sin(longitude),
          ((1 - squared_eccentricity) * normal + altitude_m) * sine};
}

LocalFrame::LocalFrame(const GpsPosition& origin)
    : origin_(origin), center_(EarthCentered(origin)) {
  const double latitude = DegToRad(origin.latitude_deg);
  const double longitude = DegToRad(origin.longitude_deg);
  const double sin_lat = std::sin(latitude), cos_lat = std::cos(latitude);
  const double sin_lon = std::sin(longitude), cos_lon = std::cos(longitude);
  enu_from_ecef_ << -sin_lon, cos_lon, 0,               // east
      -sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat,  // north
      cos_lat * cos_lon, cos_lat * sin_lon, sin_lat;    // up
}

Eigen::Vector3d LocalFrame::FromGps(const GpsPosition& position) const {
  return enu_from_ecef_ * (EarthCentered(position) - center_);
}

}  // namespace cairn
