#include "pipeline/pairs/photo_facts.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>

#include "cairn/base/error.h"
#include "cairn/base/parallel.h"
#include "cairn/base/path_in_folder.h"
#include "io/text_reader.h"

namespace cairn {
namespace {

std::optional<double> ParseNumber(std::string_view text) {
  const size_t first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return std::nullopt;
  return TextReader::ToDouble(text.substr(first, text.find_last_not_of(" \t") + 1 - first));
}

std::vector<std::string_view> SplitAtCommas(std::string_view line) {
  std::vector<std::string_view> fields;
  for (size_t begin = 0; begin <= line.size();) {
    const size_t end = std::min(line.find(',', begin), line.size());
    fields.push_back(line.substr(begin, end - begin));
    begin = end + 1;
  }
  return fields;
}

std::optional<GpsPosition> ParsePosition(const std::vector<std::string_view>& fields) {
  if (fields.size() != 3 && fields.size() != 4) return std::nullopt;
  const auto latitude = ParseNumber(fields[1]), longitude = ParseNumber(fields[2]);
  const auto altitude = fields.size() == 4 ? ParseNumber(fields[3]) : 0.0;
  if (!latitude || !longitude || !altitude) return std::nullopt;
  if (std::abs(*latitude) > 90 || std::abs(*longitude) > 180) return std::nullopt;
  return GpsPosition{*latitude, *longitude, *altitude};
}

}  // namespace

std::map<std::string, GpsPosition> ReadGpsFile(const std::string& path) {
  std::map<std::string, GpsPosition> positions;
  TextReader reader(path);
  while (reader.NextDataLine()) {
    const std::vector<std::string_view> fields = SplitAtCommas(reader.line());
    const std::optional<GpsPosition> position = ParsePosition(fields);
    if (!position) {
      reader.Fail("'" + std::string(reader.line()) + "' is not name,latitude,longitude[,altitude]");
    }
    positions[std::string(fields[0])] = *position;
  }
  return positions;
}

PhotoFacts ReadPhotoFacts(const std::vector<Image>& images, const std::string& image_path,
                          const std::string& gps_path, int num_threads) {
  std::vector<ExifInfo> exif(images.size());
  if (!image_path.empty()) {
    ParallelFor(num_threads, std::ssize(images), [&](int64_t i) {
      try {
        exif[i] = ReadExif(PathInFolder(image_path, images[i].name), 1, 1);
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
