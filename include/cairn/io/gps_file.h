#pragma once

#include <map>
#include <set>
#include <span>
#include <string>

#include "cairn/geometry/gps.h"

namespace cairn {

// A row of a file of positions.
struct GpsRow {
  GpsPosition position;
  double sigma_m = 0;  // standard deviation of the position along each axis; 0: not given
};

// Positions by image name: "name,latitude,longitude[,altitude[,sigma]]" a line, or the same with
// blanks between; degrees and meters. A line that begins with '#' is a comment, and a first line
// without a number is a header. In lines with blanks the numbers are the last words, so names may
// have blanks. Throws IoError with file and line, for two rows of one name, too.
std::map<std::string, GpsRow> ReadGpsFile(const std::string& path);

// "2 of 9 names are of no image: x.jpg, y.jpg", where some that a file mentions are none of the
// images' names; "": there are none.
std::string UnknownNames(const std::set<std::string>& mentioned,
                         std::span<const std::string> names);
std::string UnknownNames(const std::map<std::string, GpsRow>& rows,
                         std::span<const std::string> names);

}  // namespace cairn
