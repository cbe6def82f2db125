#include "cairn/image/exif.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <exiv2/exiv2.hpp>
#include <exiv2/webpimage.hpp>
#include <mutex>
#include <new>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "image/sensor_table.h"

namespace cairn {
namespace {

// Of 35 mm film, 36 mm x 24 mm.
constexpr double kFilmDiagonalMm = 43.27;
constexpr char kProjection[] = "Xmp.GPano.ProjectionType", kEquirectangular[] = "equirectangular";

// Exiv2's warnings go to the error stream unless its log is muted; its XMP parser is thread-safe
// only with a lock.
void InitializeExiv2() {
  static std::recursive_mutex xmp_mutex;
  [[maybe_unused]] static const bool is_initialized = [] {
    Exiv2::LogMsg::setLevel(Exiv2::LogMsg::mute);
    const auto lock_or_unlock = [](void* mutex, bool lock) {
      auto* const m = static_cast<std::recursive_mutex*>(mutex);
      lock ? m->lock() : m->unlock();
    };
    try {
      Exiv2::XmpParser::initialize(lock_or_unlock, &xmp_mutex);
    } catch (...) {
      throw std::bad_alloc();  // Adobe's toolkit has its own exception for that.
    }
    return true;
  }();
}

// Exiv2 goes by the first bytes, not by the name. Of all formats that it knows only those that
// photographs are read in are given to it: its readers of videos, for one, can run for ever.
bool IsPhotograph(const std::string& path) {
  const auto type = Exiv2::ImageFactory::getType(path);
  return type == Exiv2::ImageType::jpeg || type == Exiv2::ImageType::png ||
         type == Exiv2::ImageType::tiff || type == Exiv2::ImageType::webp;
}

std::string Text(const Exiv2::ExifData& data, const char* key) {
  const auto it = data.findKey(Exiv2::ExifKey(key));
  if (it == data.end()) return "";
  std::string text = it->toString();
  text.resize(std::min(text.size(), text.find('\0')));
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
  return text;
}

// (Exiv2 gives numbers without a sign as if they had one.)
std::optional<double> Ratio(const Exiv2::Exifdatum& datum, long k) {
  const Exiv2::Rational ratio = datum.toRational(k);
  if (ratio.second == 0) return std::nullopt;
  if (datum.typeId() != Exiv2::unsignedRational) {
    return static_cast<double>(ratio.first) / ratio.second;
  }
  return static_cast<double>(static_cast<uint32_t>(ratio.first)) /
         static_cast<uint32_t>(ratio.second);
}

// A finite number, or nothing.
std::optional<double> Number(const Exiv2::ExifData& data, const char* key) {
  const auto it = data.findKey(Exiv2::ExifKey(key));
  if (it == data.end() || it->count() == 0) return std::nullopt;
  return Ratio(*it, 0);
}

// A positive number, or nothing.
std::optional<double> Positive(const Exiv2::ExifData& data, const char* key) {
  const auto value = Number(data, key);
  return value && *value > 0 ? value : std::nullopt;
}

// Length of one FocalPlaneResolutionUnit in mm (EXIF 2.32: inch, the default, or centimeter; mm
// and micrometer are written by some cameras).
double FocalPlaneUnitMm(const Exiv2::ExifData& data) {
  const int unit =
      static_cast<int>(Positive(data, "Exif.Photo.FocalPlaneResolutionUnit").value_or(2));
  return unit == 3 ? 10.0 : unit == 4 ? 1.0 : unit == 5 ? 0.001 : 25.4;
}

// The longer side of the sensor. The resolution is that of the image as it left the camera, whose
// size EXIF keeps, whatever the size of the file is now.
std::optional<double> SensorLongSideMm(const Exiv2::ExifData& data) {
  const auto x_resolution = Positive(data, "Exif.Photo.FocalPlaneXResolution");
  const auto y_resolution = Positive(data, "Exif.Photo.FocalPlaneYResolution");
  const auto width = Positive(data, "Exif.Photo.PixelXDimension");
  const auto height = Positive(data, "Exif.Photo.PixelYDimension");
  if (!x_resolution || !width || !height) return std::nullopt;
  return FocalPlaneUnitMm(data) *
         std::max(*width / *x_resolution, *height / y_resolution.value_or(*x_resolution));
}

// Diagonal of the whole sensor in pixels of the image. Sensors are from 4:3 to 3:2: of a wider
// image rows of the sensor were cut off, of a squarer one columns.
double SensorDiagonalPx(int width, int height) {
  const double longer = std::max(width, height);
  const double shorter = std::min(width, height);
  return std::hypot(std::max(longer, 4.0 / 3.0 * shorter), std::max(shorter, 2.0 / 3.0 * longer));
}

// Programs that resize a photograph may write its new size, but not its new resolution: a sensor
// that differs from the known one by this factor is not that of the photograph.
constexpr double kMaxSensorRatio = 1.3;

// By what EXIF says of the sensor, and by what is known of the camera.
std::optional<double> FocalPxBySensor(const Exiv2::ExifData& data, const ExifInfo& camera,
                                      int width, int height) {
  const auto focal_mm = Positive(data, "Exif.Photo.FocalLength");
  if (!focal_mm) return std::nullopt;
  std::optional<double> told, known;
  if (const auto sensor_mm = SensorLongSideMm(data)) {
    told = *focal_mm / *sensor_mm * std::max(width, height);
  }
  if (const auto crop_factor = CropFactor(camera.camera_make, camera.camera_model)) {
    known = *focal_mm * *crop_factor / kFilmDiagonalMm * SensorDiagonalPx(width, height);
  }
  const bool differ =
      told && known && std::abs(std::log(*told / *known)) > std::log(kMaxSensorRatio);
  return told && !differ ? told : known;
}

// As ReadExif says.
std::optional<double> FocalPx(const Exiv2::ExifData& data, const ExifInfo& camera, int width,
                              int height) {
  const auto is_sensible = [&](const std::optional<double>& focal) {
    const double relative = focal.value_or(0) / std::max(width, height);
    return relative >= kMinFocalFactor && relative <= kMaxFocalFactor;
  };
  if (const auto f35 = Positive(data, "Exif.Photo.FocalLengthIn35mmFilm")) {
    const std::optional<double> focal = *f35 / kFilmDiagonalMm * std::hypot(width, height);
    if (is_sensible(focal)) return focal;
  }
  const std::optional<double> focal = FocalPxBySensor(data, camera, width, height);
  return is_sensible(focal) ? focal : std::nullopt;
}

// "2026:11:22 01:16:43" and the fraction of a second, digits.
std::optional<double> TakenAt(const std::string& text, const std::string& fraction) {
  int year = 0, month = 0, day = 0, hour = 0, minute = 0, second = 0;
  if (std::sscanf(text.c_str(), "%4d:%2d:%2d %2d:%2d:%2d", &year, &month, &day, &hour, &minute,
                  &second) != 6) {
    return std::nullopt;
  }
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(month),
                                         std::chrono::day(day)};
  if (!date.ok() || year < 1 || hour > 23 || minute > 59 || second > 60) return std::nullopt;
  double seconds = 86400.0 * std::chrono::sys_days(date).time_since_epoch().count();
  seconds += 3600.0 * hour + 60.0 * minute + second;
  const bool is_number = fraction.find_first_not_of("0123456789") == std::string::npos;
  if (is_number && !fraction.empty()) seconds += std::stod("0." + fraction);
  return seconds;
}

// The first time that is there: when it was taken, digitized, last changed.
std::optional<double> TakenAt(const Exiv2::ExifData& data) {
  constexpr const char* kTimes[][2] = {
      {"Exif.Photo.DateTimeOriginal", "Exif.Photo.SubSecTimeOriginal"},
      {"Exif.Photo.DateTimeDigitized", "Exif.Photo.SubSecTimeDigitized"},
      {"Exif.Image.DateTime", "Exif.Photo.SubSecTime"}};
  for (const auto& [time, fraction] : kTimes) {
    if (const auto taken_at_s = TakenAt(Text(data, time), Text(data, fraction))) return taken_at_s;
  }
  return std::nullopt;
}

// Degrees, minutes and seconds as one number of degrees.
std::optional<double> Degrees(const Exiv2::ExifData& data, const char* key) {
  const auto it = data.findKey(Exiv2::ExifKey(key));
  if (it == data.end() || it->count() == 0) return std::nullopt;
  double degrees = 0, unit = 1;
  for (long k = 0; k < std::min<long>(3, it->count()); ++k, unit /= 60) {
    const std::optional<double> part = Ratio(*it, k);
    if (!part) return std::nullopt;
    degrees += unit * *part;
  }
  return degrees;
}

// Higher ones, such as 4294967295, stand for none. (Balloons reach 50 km.)
constexpr double kMaxAltitudeM = 1e5;

// Cameras without a fix write zeros: 0 degrees north, 0 east is taken as absent.
std::optional<GpsPosition> Gps(const Exiv2::ExifData& data) {
  const auto latitude = Degrees(data, "Exif.GPSInfo.GPSLatitude");
  const auto longitude = Degrees(data, "Exif.GPSInfo.GPSLongitude");
  if (!latitude || !longitude || (*latitude == 0 && *longitude == 0)) return std::nullopt;
  GpsPosition gps{*latitude, *longitude, Number(data, "Exif.GPSInfo.GPSAltitude")};
  if (gps.altitude_m && *gps.altitude_m > kMaxAltitudeM) gps.altitude_m.reset();
  const auto is_of = [&](const char* key, char upper, char lower) {
    const std::string text = Text(data, key);  // some write the word, or small letters
    return text.starts_with(upper) || text.starts_with(lower);
  };
  if (is_of("Exif.GPSInfo.GPSLatitudeRef", 'S', 's')) gps.latitude_deg *= -1;
  if (is_of("Exif.GPSInfo.GPSLongitudeRef", 'W', 'w')) gps.longitude_deg *= -1;
  const bool is_below = Text(data, "Exif.GPSInfo.GPSAltitudeRef") == "1";
  if (gps.altitude_m && is_below) *gps.altitude_m *= -1;
  return gps.IsOnEarth() ? std::optional(gps) : std::nullopt;
}

// Degrees as EXIF has them: degrees, minutes, and hundred-thousandths of seconds.
std::string DegreesText(double degrees) {
  const auto units = static_cast<int64_t>(std::llround(std::abs(degrees) * 3600e5));
  return std::to_string(units / 360000000) + "/1 " + std::to_string(units / 6000000 % 60) + "/1 " +
         std::to_string(units % 6000000) + "/100000";
}

void AddGps(const GpsPosition& gps, Exiv2::ExifData& data) {
  data["Exif.GPSInfo.GPSLatitude"] = DegreesText(gps.latitude_deg);
  data["Exif.GPSInfo.GPSLatitudeRef"] = gps.latitude_deg < 0 ? "S" : "N";
  data["Exif.GPSInfo.GPSLongitude"] = DegreesText(gps.longitude_deg);
  data["Exif.GPSInfo.GPSLongitudeRef"] = gps.longitude_deg < 0 ? "W" : "E";
  if (!gps.altitude_m) return;
  data["Exif.GPSInfo.GPSAltitude"] =
      std::to_string(std::llround(std::abs(*gps.altitude_m) * 1000)) + "/1000";
  data["Exif.GPSInfo.GPSAltitudeRef"] = *gps.altitude_m < 0 ? "1" : "0";
}

bool IsPanorama(const Exiv2::XmpData& data, int width, int height) {
  const auto type = data.findKey(Exiv2::XmpKey(kProjection));
  return type != data.end() && type->toString() == kEquirectangular && width == 2 * height;
}

}  // namespace

ExifInfo ReadExif(const std::string& path, int width, int height) {
  InitializeExiv2();
  InputFile{path};  // throws where it cannot be read
  ExifInfo info;
  try {
    if (!IsPhotograph(path)) return info;
    const auto image = Exiv2::ImageFactory::open(path);
    image->readMetadata();
    const Exiv2::ExifData& data = image->exifData();
    info.camera_make = Text(data, "Exif.Image.Make");
    info.camera_model = Text(data, "Exif.Image.Model");
    info.taken_at_s = TakenAt(data);
    info.gps = Gps(data);
    info.focal_px = FocalPx(data, info, width, height);
    info.is_panorama = IsPanorama(image->xmpData(), width, height);
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception&) {
    return {};  // no image that Exiv2 knows, or damaged metadata: EXIF is never required
  }
  return info;
}

void WriteExif(const std::string& path, const ExifTags& tags) {
  InitializeExiv2();
  try {
    const auto image = Exiv2::ImageFactory::open(path);
    image->readMetadata();
    Exiv2::ExifData& data = image->exifData();
    data["Exif.Image.Make"] = tags.camera_make;
    data["Exif.Image.Model"] = tags.camera_model;
    data["Exif.Photo.FocalLengthIn35mmFilm"] = static_cast<uint16_t>(tags.focal_length_35mm);
    if (!tags.taken_at.empty()) data["Exif.Photo.DateTimeOriginal"] = tags.taken_at;
    if (tags.gps) AddGps(*tags.gps, data);
    if (tags.is_panorama) image->xmpData()[kProjection] = kEquirectangular;
    image->writeMetadata();
  } catch (const Exiv2::Error& error) {
    throw IoError(path, std::string("EXIF cannot be written: ") + error.what());
  }
}

}  // namespace cairn
