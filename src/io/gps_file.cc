#include "cairn/io/gps_file.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "base/text.h"
#include "io/text_reader.h"

namespace cairn {
namespace {

// A line's name, and the texts of its numbers.
struct GpsFields {
  std::string name;
  std::vector<std::string> numbers;
};

// Fields between commas, without the quotes that spreadsheets put them in (RFC 4180).
std::vector<std::string> CsvFields(std::string_view line) {
  std::vector<std::string> fields(1);
  bool is_quoted = false;
  for (size_t i = 0; i < line.size(); ++i) {
    std::string& field = fields.back();
    if (line[i] == ',' && !is_quoted) {
      fields.emplace_back();
    } else if (line[i] != '"' || !(is_quoted || Trimmed(field).empty())) {
      field += line[i];
    } else if (is_quoted && line.substr(i + 1).starts_with('"')) {
      field += line[i++];
    } else {
      is_quoted = !is_quoted;
    }
  }
  for (std::string& field : fields) field = std::string(Trimmed(field));
  return fields;
}

// Cells at the end may be empty.
GpsFields SplitAtCommas(std::string_view line) {
  std::vector<std::string> numbers = CsvFields(line);
  std::string name = std::move(numbers.front());
  numbers.erase(numbers.begin());
  while (!numbers.empty() && numbers.back().empty()) numbers.pop_back();
  return {std::move(name), std::move(numbers)};
}

GpsFields SplitAtBlanks(std::string_view line) {
  std::string_view name = Trimmed(line);
  std::vector<std::string> numbers;
  while (numbers.size() < 4) {
    const size_t blank = name.find_last_of(" \t");
    if (blank == std::string_view::npos) break;
    const std::string_view word = name.substr(blank + 1);
    if (!TextReader::ToDouble(word)) break;
    numbers.insert(numbers.begin(), std::string(word));
    name = Trimmed(name.substr(0, blank));
  }
  return {std::string(name), std::move(numbers)};
}

// "name,latitude,longitude": what a spreadsheet has above its rows. Throws IoError where it names
// another order.
bool IsHeader(TextReader& reader) {
  const bool has_commas = reader.line().find(',') != std::string_view::npos;
  std::vector<std::string> words;
  if (has_commas) {
    words = CsvFields(reader.line());
  } else {
    for (const std::string_view word : reader.RemainingWords()) words.emplace_back(word);
  }
  std::erase(words, "");
  const bool is_header =
      words.size() > 2 && std::none_of(words.begin() + 1, words.end(), [](std::string_view word) {
        return TextReader::ToDouble(word).has_value();
      });
  if (!is_header) return false;
  const auto begins = [&](const std::string& word, const std::string& name) {
    const std::string lower = Lowercase(word);
    return lower.starts_with(name) || lower.starts_with("gps" + name);  // exiftool's
  };
  const auto names_axis = [&](const std::string& word) {
    return begins(word, "lat") || begins(word, "lon");
  };
  if (std::ranges::any_of(words, names_axis) &&
      !(begins(words[1], "lat") && begins(words[2], "lon"))) {
    reader.Fail("its columns are in another order than name,latitude,longitude");
  }
  return true;
}

std::optional<GpsRow> ParseRow(const GpsFields& fields) {
  if (fields.numbers.size() < 2 || fields.numbers.size() > 4) return std::nullopt;
  const std::vector<std::string_view> words(fields.numbers.begin(), fields.numbers.end());
  const auto values = TextReader::ToDoubles(words);
  if (!values) return std::nullopt;
  GpsRow row{{values->at(0), values->at(1)}};
  if (values->size() > 2) row.position.altitude_m = values->at(2);
  if (values->size() > 3) row.sigma_m = values->at(3);
  return row.sigma_m >= 0 ? std::optional(row) : std::nullopt;
}

}  // namespace

std::map<std::string, GpsRow> ReadGpsFile(const std::string& path) {
  std::map<std::string, GpsRow> rows;
  TextReader reader(path);
  for (bool is_first = true; reader.NextDataLine(); is_first = false) {
    if (is_first && IsHeader(reader)) continue;
    const bool has_commas = reader.line().find(',') != std::string_view::npos;
    const GpsFields fields =
        has_commas ? SplitAtCommas(reader.line()) : SplitAtBlanks(reader.line());
    if (has_commas && fields.numbers.empty()) continue;  // it has no position
    const std::optional<GpsRow> row = ParseRow(fields);
    if (!row) {
      reader.Fail("'" + std::string(reader.line()) +
                  "' is not name,latitude,longitude[,altitude[,sigma]]");
    }
    if (!row->position.IsOnEarth()) {
      reader.Fail("'" + std::string(reader.line()) +
                  "': its latitude or longitude is out of range");
    }
    if (!rows.try_emplace(fields.name, *row).second) {
      reader.Fail("'" + fields.name + "' has a position already");
    }
  }
  return rows;
}

std::string UnknownNames(const std::set<std::string>& mentioned,
                         std::span<const std::string> names) {
  const std::set<std::string> known(names.begin(), names.end());
  std::vector<std::string> unknown;
  for (const std::string& name : mentioned) {
    if (!known.contains(name)) unknown.push_back(name);
  }
  if (unknown.empty()) return "";
  return std::to_string(unknown.size()) + " of " + std::to_string(mentioned.size()) +
         " names are of no image: " + FirstNames(unknown);
}

std::string UnknownNames(const std::map<std::string, GpsRow>& rows,
                         std::span<const std::string> names) {
  std::set<std::string> mentioned;
  for (const auto& [name, row] : rows) mentioned.insert(name);
  return UnknownNames(mentioned, names);
}

}  // namespace cairn
