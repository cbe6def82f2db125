#include "cairn/io/gcp_file.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <optional>

#include "io/text_reader.h"

namespace cairn {
namespace {

// What the first line says.
struct GcpProjection {
  int utm_zone = 0;  // 0: degrees
  bool is_south = false;
};

// Of the words of the first line, in capitals. UTM is written in three ways; PROJ's is
// "+proj=utm +zone=32 [+south] +datum=WGS84 ...".
std::optional<GcpProjection> ParseGcpProjection(const std::vector<std::string_view>& words) {
  const auto has = [&](std::string_view word) {
    return std::find(words.begin(), words.end(), word) != words.end();
  };
  const std::string_view first = words.front(), last = words.back();
  if (words.size() == 1 && (first == "EPSG:4326" || first == "WGS84")) return GcpProjection{};
  std::string_view zone;
  bool is_south = false;
  if (words.size() == 1 && (first.starts_with("EPSG:326") || first.starts_with("EPSG:327"))) {
    zone = first.substr(8);
    is_south = first[7] == '7';
  } else if (words.size() == 3 && first == "WGS84" && words[1] == "UTM") {
    is_south = last.ends_with('S');
    if (is_south || last.ends_with('N')) zone = last.substr(0, last.size() - 1);
  } else if (first == "+PROJ=UTM" && (has("+DATUM=WGS84") || has("+ELLPS=WGS84"))) {
    for (const std::string_view word : words) {
      if (word.starts_with("+ZONE=")) zone = word.substr(6);
    }
    is_south = has("+SOUTH");
  }
  int number = 0;
  const char* const end = zone.data() + zone.size();
  const auto parsed = std::from_chars(zone.data(), end, number);
  const bool is_zone = parsed.ec == std::errc() && parsed.ptr == end && number >= 1 && number <= 60;
  return is_zone ? std::optional(GcpProjection{number, is_south}) : std::nullopt;
}

GcpProjection ReadGcpProjection(TextReader& reader) {
  reader.ExpectDataLine("the projection");
  std::string upper(reader.line());
  std::transform(upper.begin(), upper.end(), upper.begin(),
                 [](unsigned char c) { return std::toupper(c); });
  std::vector<std::string_view> words;
  for (const std::string_view word : reader.RemainingWords()) {
    words.push_back(
        std::string_view(upper).substr(word.data() - reader.line().data(), word.size()));
  }
  const auto projection = ParseGcpProjection(words);
  if (!projection) {
    reader.Fail("'" + std::string(reader.line()) +
                "' is no projection that is read: EPSG:4326, or WGS84 UTM such as "
                "WGS84 UTM 32N or EPSG:32632");
  }
  return *projection;
}

std::vector<std::string_view> GcpFields(TextReader& reader) {
  const bool has_tabs = reader.line().find('\t') != std::string_view::npos;
  if (!has_tabs) return reader.RemainingWords();
  std::vector<std::string_view> fields = Split(reader.line(), '\t');
  for (std::string_view& field : fields) field = Trimmed(field);
  return fields;
}

// A measurement.
struct GcpRow {
  std::string name;
  GpsPosition position;
  Eigen::Vector2d pixel;
  std::string image;
};

std::optional<GcpRow> ParseGcpRow(const std::vector<std::string_view>& fields,
                                  const GcpProjection& projection) {
  if (fields.size() < 6 || fields[5].empty()) return std::nullopt;
  const auto numbers = TextReader::ToDoubles(std::span(fields).first(5));
  if (!numbers) return std::nullopt;
  const std::vector<double>& values = *numbers;
  // (To OpenDroneMap the center of the top-left pixel is (0, 0).)
  const Eigen::Vector2d pixel(values[3] + 0.5, values[4] + 0.5);
  GcpRow row{"", {values[1], values[0]}, pixel, std::string(fields[5])};
  if (projection.utm_zone > 0) {
    row.position = GpsFromUtm(projection.utm_zone, projection.is_south, values[0], values[1]);
  }
  row.position.altitude_m = values[2];
  if (!row.position.IsOnEarth()) return std::nullopt;
  if (fields.size() > 6) row.name = fields[6];
  if (!row.name.empty()) return row;
  for (int i = 0; i < 3; ++i) row.name += (i > 0 ? " " : "") + std::string(fields[i]);
  return row;
}

}  // namespace

std::vector<ControlPoint> ReadGcpFile(const std::string& path) {
  TextReader reader(path);
  const GcpProjection projection = ReadGcpProjection(reader);
  std::vector<ControlPoint> points;
  std::map<std::string, size_t> indices;
  while (reader.NextDataLine()) {
    const std::optional<GcpRow> row = ParseGcpRow(GcpFields(reader), projection);
    if (!row) {
      reader.Fail("'" + std::string(reader.line()) + "' is not x y z pixel_x pixel_y image [name]");
    }
    const auto [index, is_new] = indices.try_emplace(row->name, points.size());
    if (is_new) points.push_back({row->name, row->position, row->name.starts_with("CHK-")});
    ControlPoint& point = points[index->second];
    if (EarthCentered(point.position) != EarthCentered(row->position)) {
      reader.Fail("'" + row->name + "' has other coordinates than before");
    }
    if (!point.pixels.emplace(row->image, row->pixel).second) {
      reader.Fail("'" + row->name + "' is measured twice in " + row->image);
    }
  }
  return points;
}

}  // namespace cairn
