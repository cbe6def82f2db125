#include "pipeline/pairs/photo_facts.h"

#include <charconv>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>

#include "cairn/base/error.h"
#include "cairn/base/parallel.h"

namespace cairn {
namespace {

std::optional<double> FiniteNumber(std::string text) {
  const size_t first = text.find_first_not_of(" \t");
  if (first == std::string::npos) return std::nullopt;
  text = text.substr(first, text.find_last_not_of(" \t\r") + 1 - first);
  double value = 0;
  const char* const end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  if (result.ec != std::errc() || result.ptr != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::vector<std::string> SplitAtCommas(const std::string& line) {
  std::vector<std::string> fields;
  size_t begin = 0;
  while (true) {
    const size_t end = line.find(',', begin);
    fields.push_back(line.substr(begin, end - begin));
    if (end == std::string::npos) return fields;
    begin = end + 1;
  }
}

std::optional<GpsPosition> ParsePosition(const std::vector<std::string>& fields) {
  if (fields.size() != 3 && fields.size() != 4) return std::nullopt;
  const auto latitude = FiniteNumber(fields[1]), longitude = FiniteNumber(fields[2]);
  const auto altitude = fields.size() == 4 ? FiniteNumber(fields[3]) : 0.0;
  if (!latitude || !longitude || !altitude) return std::nullopt;
  if (std::abs(*latitude) > 90 || std::abs(*longitude) > 180) return std::nullopt;
  return GpsPosition{*latitude, *longitude, *altitude};
}

}  // namespace

std::map<std::string, GpsPosition> ReadGpsFile(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw IoError(path, "cannot be opened");
  std::map<std::string, GpsPosition> positions;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (line.find_first_not_of(" \t\r") == std::string::npos || line[0] == '#') continue;
    const std::vector<std::string> fields = SplitAtCommas(line);
    const std::optional<GpsPosition> position = ParsePosition(fields);
    if (!position) {
      throw IoError(path + ":" + std::to_string(number),
                    "'" + line + "' is not name,latitude,longitude[,altitude]");
    }
    positions[fields[0]] = *position;
  }
  if (file.bad()) throw IoError(path, "cannot be read");
  return positions;
}

PhotoFacts ReadPhotoFacts(const std::vector<Image>& images, const std::string& image_path,
                          const std::string& gps_path, int num_threads) {
  std::vector<ExifInfo> exif(images.size());
  if (!image_path.empty()) {
    ParallelFor(num_threads, std::ssize(images), [&](int64_t i) {
      try {
        exif[i] = ReadExif(std::filesystem::path(image_path) / images[i].name, 1, 1);
      } catch (const IoError&) {  // Its features came from elsewhere.
      }
    });
  }
  std::map<std::string, GpsPosition> given;
  if (!gps_path.empty()) given = ReadGpsFile(gps_path);
  PhotoFacts facts;
  for (size_t i = 0; i < images.size(); ++i) {
    const image_t id = images[i].image_id;
    if (exif[i].taken_at_s) facts.taken_at_s[id] = *exif[i].taken_at_s;
    const auto position = given.find(images[i].name);
    if (position != given.end()) {
      facts.positions[id] = position->second;
    } else if (gps_path.empty() && exif[i].gps) {
      facts.positions[id] = *exif[i].gps;
    }
  }
  return facts;
}

}  // namespace cairn
