#include "cairn/io/gps_file.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "io/text_reader.h"

namespace cairn {
namespace {

constexpr char kBlanks[] = " \t";

std::string_view WithoutBlanks(std::string_view text) {
  const size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return "";
  return text.substr(first, text.find_last_not_of(kBlanks) + 1 - first);
}

// A line's name, and the texts of its numbers.
struct GpsFields {
  std::string_view name;
  std::vector<std::string_view> numbers;
};

GpsFields SplitAtCommas(std::string_view line) {
  GpsFields fields;
  fields.name = line.substr(0, line.find(','));
  for (size_t begin = fields.name.size() + 1; begin <= line.size();) {
    const size_t end = std::min(line.find(',', begin), line.size());
    fields.numbers.push_back(WithoutBlanks(line.substr(begin, end - begin)));
    begin = end + 1;
  }
  return fields;
}

GpsFields SplitAtBlanks(std::string_view line) {
  GpsFields fields;
  fields.name = WithoutBlanks(line);
  while (fields.numbers.size() < 4) {
    const size_t blank = fields.name.find_last_of(kBlanks);
    if (blank == std::string_view::npos) break;
    const std::string_view word = fields.name.substr(blank + 1);
    if (!TextReader::ToDouble(word)) break;
    fields.numbers.insert(fields.numbers.begin(), word);
    fields.name = WithoutBlanks(fields.name.substr(0, blank));
  }
  return fields;
}

std::optional<GpsRow> ParseRow(const GpsFields& fields) {
  if (fields.numbers.size() < 2 || fields.numbers.size() > 4) return std::nullopt;
  double values[4] = {};
  for (size_t i = 0; i < fields.numbers.size(); ++i) {
    const auto value = TextReader::ToDouble(fields.numbers[i]);
    if (!value) return std::nullopt;
    values[i] = *value;
  }
  if (std::abs(values[0]) > 90 || std::abs(values[1]) > 180 || values[3] < 0) return std::nullopt;
  GpsRow row{{values[0], values[1]}, values[3]};
  if (fields.numbers.size() > 2) row.position.altitude_m = values[2];
  return row;
}

}  // namespace

std::map<std::string, GpsRow> ReadGpsFile(const std::string& path) {
  std::map<std::string, GpsRow> rows;
  TextReader reader(path);
  while (reader.NextDataLine()) {
    const bool has_commas = reader.line().find(',') != std::string_view::npos;
    const GpsFields fields =
        has_commas ? SplitAtCommas(reader.line()) : SplitAtBlanks(reader.line());
    const std::optional<GpsRow> row = ParseRow(fields);
    if (!row) {
      reader.Fail("'" + std::string(reader.line()) +
                  "' is not name,latitude,longitude[,altitude[,sigma]]");
    }
    rows[std::string(fields.name)] = *row;
  }
  return rows;
}

}  // namespace cairn
