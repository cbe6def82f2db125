#pragma once

#include <Eigen/Core>
#include <Eigen/LU>

#include "cairn/geometry/gps.h"

namespace cairn {

// The inverse of LocalFrame::FromGps, by Newton's method on differences.
inline GpsPosition GpsAt(const LocalFrame& frame, const Eigen::Vector3d& enu) {
  const GpsPosition& origin = frame.origin();
  Eigen::Vector3d gps(origin.latitude_deg, origin.longitude_deg, origin.altitude_m.value_or(0));
  const auto at = [&](const Eigen::Vector3d& v) { return frame.FromGps({v.x(), v.y(), v.z()}); };
  for (int i = 0; i < 8; ++i) {
    Eigen::Matrix3d J;
    const Eigen::Vector3d steps(1e-4, 1e-4, 10);
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d step = steps[k] * Eigen::Vector3d::Unit(k);
      J.col(k) = (at(gps + step) - at(gps - step)) / (2 * steps[k]);
    }
    gps += J.inverse() * (enu - at(gps));
  }
  return {gps.x(), gps.y(), gps.z()};
}

}  // namespace cairn
