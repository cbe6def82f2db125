#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "cairn/geometry/gps.h"
#include "cairn/georegistration/georegister.h"

namespace cairn {

// A place that is known, and where the model has it.
struct Row {
  Eigen::Vector3d in_model, enu;
  double sigma_m = 0;
  bool has_height = true;
  double given_sigma_m = 0;  // 0: it is not given
  bool is_wrong = false;
  Eigen::Vector3d residual = Eigen::Vector3d::Zero();  // without a height, z is 0
};
using Rows = std::vector<Row>;

// Of east, north and up: the middle of the control points, if three are not checks; else of the
// images.
GpsPosition OriginOf(const KnownPositions& known);

// The images that have positions, as rows; all with an altitude, or none. Those without sigma are
// as good as the middle one of those that have it.
Rows FindImages(const Reconstruction& model, const std::map<std::string, GpsRow>& rows,
                const LocalFrame& frame, Georegistration& out);

// The control points that the model has, as rows.
Rows FindPoints(const Reconstruction& model, const std::vector<ControlPoint>& points,
                const LocalFrame& frame, Georegistration& out);

}  // namespace cairn
