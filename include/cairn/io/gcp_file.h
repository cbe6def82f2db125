#pragma once

#include <Eigen/Core>
#include <map>
#include <string>
#include <vector>

#include "cairn/geometry/gps.h"

namespace cairn {

// A surveyed point on the ground, and where photographs show it.
struct ControlPoint {
  std::string name;
  GpsPosition position;                                // with an altitude
  bool is_check = false;                               // measures the model, and does not shape it
  std::map<std::string, Eigen::Vector2d> pixels = {};  // by image name; pixels
};

// OpenDroneMap's gcp_list.txt: the first line names the coordinates ("EPSG:4326": longitude,
// latitude, altitude; "WGS84 UTM 32N", "EPSG:32632" or "+proj=utm +zone=32 +datum=WGS84": easting,
// northing, altitude), each other one is a measurement: x y z pixel_x pixel_y image [name], blanks
// or, where names have blanks, tabs between. A line that begins with '#' is a comment. Lines of one
// name, or without a name of the same coordinates, are one point. Names that begin with "CHK-" are
// of check points. In the order of the file. Throws IoError with file and line.
std::vector<ControlPoint> ReadGcpFile(const std::string& path);

}  // namespace cairn
