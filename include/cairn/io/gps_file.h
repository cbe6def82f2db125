#pragma once

#include <map>
#include <string>

#include "cairn/geometry/gps.h"

namespace cairn {

// A row of a file of positions.
struct GpsRow {
  GpsPosition position;
  double sigma_m = 0;  // standard deviation of the position along each axis; 0: not given
};

// Positions by image name: "name,latitude,longitude[,altitude[,sigma]]" a line, or the same with
// blanks between; degrees and meters; '#' begins a comment. In lines with blanks the numbers are
// the last words, so names may have blanks. Throws IoError with file and line.
std::map<std::string, GpsRow> ReadGpsFile(const std::string& path);

}  // namespace cairn
