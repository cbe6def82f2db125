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

GpsPosition GpsFromUtm(int zone, bool is_south, double easting_m, double northing_m) {
  constexpr double n = kFlattening / (2 - kFlattening);
  constexpr double n2 = n * n, n3 = n2 * n, n4 = n2 * n2;
  constexpr double kScale = 0.9996, kFalseEastingM = 500e3, kFalseNorthingM = 10000e3;
  constexpr double kRectifyingM = kSemiMajorM / (1 + n) * (1 + n2 / 4 + n4 / 64);
  constexpr double kPlane[4] = {n / 2 - 2 * n2 / 3 + 37 * n3 / 96 - n4 / 360,
                                n2 / 48 + n3 / 15 - 437 * n4 / 1440, 17 * n3 / 480 - 37 * n4 / 840,
                                4397 * n4 / 161280};
  const double xi = (northing_m - (is_south ? kFalseNorthingM : 0)) / (kScale * kRectifyingM);
  const double eta = (easting_m - kFalseEastingM) / (kScale * kRectifyingM);
  double north = xi, east = eta;
  for (int j = 0; j < 4; ++j) {
    const double k = 2.0 * (j + 1);
    north -= kPlane[j] * std::sin(k * xi) * std::cosh(k * eta);
    east -= kPlane[j] * std::cos(k * xi) * std::sinh(k * eta);
  }
  // From the conformal latitude; each round is 150 times as exact.
  const double eccentricity = std::sqrt(kFlattening * (2 - kFlattening));
  const double isometric = std::atanh(std::sin(north) / std::cosh(east));
  double sine = std::sin(north) / std::cosh(east);
  for (int round = 0; round < 8; ++round) {
    sine = std::tanh(isometric + eccentricity * std::atanh(eccentricity * sine));
  }
  const double from_meridian = std::atan2(std::sinh(east), std::cos(north));
  const double longitude_deg = 6.0 * zone - 183.0 + RadToDeg(from_meridian);
  return {RadToDeg(std::asin(sine)), std::remainder(longitude_deg, 360.0)};
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
