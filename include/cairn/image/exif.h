#pragma once

#include <optional>
#include <string>

#include "cairn/geometry/gps.h"

namespace cairn {

// Focal lengths in units of the longer side that a photograph can have: 4 mm to 1100 mm of 35 mm
// film.
inline constexpr double kMinFocalFactor = 0.1;
inline constexpr double kMaxFocalFactor = 30.0;

// What a photograph's EXIF block holds about its camera, and about when and where it was taken.
struct ExifInfo {
  // In pixels of an image of the size given to ReadExif; absent where EXIF has none.
  std::optional<double> focal_px;
  std::string camera_make;   // "" if absent, without trailing blanks
  std::string camera_model;  // "" if absent, without trailing blanks
  // By the camera's clock, seconds since 1970-01-01 of its own time zone, with fractions where the
  // camera wrote them.
  std::optional<double> taken_at_s;
  std::optional<GpsPosition> gps;
  bool is_panorama = false;  // the whole sphere, equirectangular, by XMP (Google's Photo Sphere)
};

// Reads EXIF of an image that is width x height pixels. The focal length as COLMAP computes it:
// from the 35 mm equivalent, f35 / 43.27 * sqrt(w^2 + h^2), else from the focal length in mm with
// the sensor's size by FocalPlaneXResolution, f_mm / sensor_mm * max(w, h); else with the sensor's
// diagonal, which lensfun's database has for make and model (the sensor being as wide or as high as
// the image, its sides as 4:3 to 3:2). A focal length that no photograph has (shorter than a tenth
// of the longer side, or longer than 30 of them) is taken as absent. An image without EXIF, or with
// EXIF that cannot be parsed, gives an empty result; throws IoError only where the file cannot be
// read. Prints nothing. Thread-safe.
ExifInfo ReadExif(const std::string& path, int width, int height);

// What WriteExif writes into an existing JPEG or PNG file.
struct ExifTags {
  int focal_length_35mm = 0;  // 35 mm equivalent, mm
  std::string camera_make = {};
  std::string camera_model = {};
  std::string taken_at = {};  // "2026:11:22 01:16:43"; "": no time
  std::optional<GpsPosition> gps = {};
  bool is_panorama = false;
};

// Adds the tags to the image's EXIF block; tags of other names stay. Throws IoError.
void WriteExif(const std::string& path, const ExifTags& tags);

}  // namespace cairn
