#pragma once

#include <cmath>
#include <string>

#include "cairn/scene/reconstruction.h"

namespace cairn {

// The two formats of a COLMAP model. The readers check each file by itself; colmap_model.cc checks
// what the files say about each other.
Reconstruction ReadColmapBinary(const std::string& folder);
Reconstruction ReadColmapText(const std::string& folder);
void WriteColmapBinary(const Reconstruction& reconstruction, const std::string& folder);
void WriteColmapText(const Reconstruction& reconstruction, const std::string& folder);

// As stored if of unit length to rounding, else normalized; zero if it cannot be.
Eigen::Quaterniond UnitQuaternion(double w, double x, double y, double z);

// error_px, or -1 ("not computed") where it is not finite: a point behind a camera.
inline double StoredError(const Point3D& point) {
  return std::isfinite(point.error_px) ? point.error_px : -1.0;
}

}  // namespace cairn
