#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>

namespace cairn {

// A place on Earth, WGS84.
struct GpsPosition {
  double latitude_deg = 0;   // positive: north
  double longitude_deg = 0;  // positive: east
  // Above the ellipsoid, or what the receiver took for it; absent: not known.
  std::optional<double> altitude_m = {};

  bool IsOnEarth() const { return std::abs(latitude_deg) <= 90 && std::abs(longitude_deg) <= 180; }
};

// Earth-centered, Earth-fixed, meters; on the ellipsoid where the altitude is not known.
Eigen::Vector3d EarthCentered(const GpsPosition& position);

// The place with these coordinates of UTM on WGS84, meters; zone 1 to 60. Krueger's series to the
// fourth order (Karney, "Transverse Mercator with an accuracy of a few nanometers", 2011): below a
// micrometer within 3,000 km of the zone.
GpsPosition GpsFromUtm(int zone, bool is_south, double easting_m, double northing_m);

// East-north-up axes at a place: x east, y north, z up (along the ellipsoid's normal), meters from
// it. Exact at any distance: axes are straight and do not follow the Earth's curve.
class LocalFrame {
 public:
  explicit LocalFrame(const GpsPosition& origin);
  const GpsPosition& origin() const { return origin_; }
  Eigen::Vector3d FromGps(const GpsPosition& position) const;

 private:
  GpsPosition origin_;
  Eigen::Vector3d center_;
  Eigen::Matrix3d enu_from_ecef_;
};

}  // namespace cairn
