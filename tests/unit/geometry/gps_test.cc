#include "cairn/geometry/gps.h"

#include <Eigen/Core>
#include <cmath>

#include "cairn/math/angles.h"
#include "support/test.h"

namespace cairn {
namespace {

// Along its central meridian, UTM is 0.9996 times the length of the meridian: integrated here.
double MeridianM(double latitude_deg) {
  const double e2 = (2 - 1 / 298.257223563) / 298.257223563;
  const auto curvature = [&](double phi) {
    return 6378137.0 * (1 - e2) / std::pow(1 - e2 * std::sin(phi) * std::sin(phi), 1.5);
  };
  const int n = 2000;  // Simpson's rule
  const double h = DegToRad(latitude_deg) / n;
  double sum = 0;
  for (int i = 0; i <= n; ++i) {
    sum += (i == 0 || i == n ? 1 : i % 2 == 1 ? 4 : 2) * curvature(i * h);
  }
  return sum * h / 3;
}

TEST(Utm, IsExactOnTheCentralMeridian) {
  for (const double latitude : {0.0, 12.5, 47.0, 71.0}) {
    const double northing = 0.9996 * MeridianM(latitude);
    const GpsPosition north = GpsFromUtm(32, false, 500e3, northing);
    const GpsPosition south = GpsFromUtm(55, true, 500e3, 10000e3 - northing);
    EXPECT_NEAR(north.latitude_deg, latitude, 1e-12);  // 0.1 micrometers
    EXPECT_NEAR(north.longitude_deg, 9, 1e-12);
    EXPECT_NEAR(south.latitude_deg, -latitude, 1e-12);
    EXPECT_NEAR(south.longitude_deg, 147, 1e-12);
  }
}

TEST(Utm, LongitudesStayBelow180Degrees) {
  EXPECT_NEAR(GpsFromUtm(60, true, 830e3, 8140e3).longitude_deg, -179.904, 1e-3);
  EXPECT_NEAR(GpsFromUtm(1, true, 170e3, 8140e3).longitude_deg, 179.904, 1e-3);
}

// A conformal map is known by its values along one line: that it is one is all that remains.
TEST(Utm, IsConformal) {
  for (const double easting : {200e3, 350e3, 731234.5}) {
    const double northing = 5201234.5, step = 100;
    const LocalFrame frame(GpsFromUtm(32, false, easting, northing));
    const auto at = [&](double x, double y) -> Eigen::Vector2d {
      return frame.FromGps(GpsFromUtm(32, false, easting + x, northing + y)).head<2>();
    };
    const Eigen::Vector2d east = (at(step, 0) - at(-step, 0)) / (2 * step);
    const Eigen::Vector2d north = (at(0, step) - at(0, -step)) / (2 * step);
    EXPECT_NEAR(east.x(), north.y(), 1e-9);
    EXPECT_NEAR(east.y(), -north.x(), 1e-9);
    EXPECT_NEAR(east.norm(), 1, 1e-3);
  }
}

}  // namespace
}  // namespace cairn
