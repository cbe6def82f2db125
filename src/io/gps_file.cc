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
  std::string_view name;
  std::vector<std::string_view> numbers;
};

GpsFields SplitAtCommas(std::string_view line) {
  std::vector<std::string_view> numbers = Split(line, ',');
  const std::string_view name = Trimmed(numbers.front());
  numbers.erase(numbers.begin());
  for (std::string_view& number : numbers) number = Trimmed(number);
  return {name, std::move(numbers)};
}

GpsFields SplitAtBlanks(std::string_view line) {
  GpsFields fields;
  fields.name = Trimmed(line);
  while (fields.numbers.size() < 4) {
    const size_t blank = fields.name.find_last_of(" \t");
    if (blank == std::string_view::npos) break;
    const std::string_view word = fields.name.substr(blank + 1);
    if (!TextReader::ToDouble(word)) break;
    fields.numbers.insert(fields.numbers.begin(), word);
    fields.name = Trimmed(fields.name.substr(0, blank));
  }
  return fields;
}

// "name,latitude,longitude": what a spreadsheet has above its rows. Throws IoError where it names
// another order.
bool IsHeader(TextReader& reader) {
  const bool has_commas = reader.line().find(',') != std::string_view::npos;
  std::vector<std::string_view> words =
      has_commas ? Split(reader.line(), ',') : reader.RemainingWords();
  std::erase_if(words, [](std::string_view word) { return Trimmed(word).empty(); });
  const bool is_header =
      words.size() > 2 && std::none_of(words.begin() + 1, words.end(), [](std::string_view word) {
        return TextReader::ToDouble(Trimmed(word)).has_value();
      });
  if (!is_header) return false;
  const auto begins = [&](std::string_view word, std::string_view name) {
    word = Trimmed(word);
    if (word.starts_with('"')) word.remove_prefix(1);
    return Lowercase(std::string(word)).starts_with(name);
  };
  const auto names_axis = [&](std::string_view word) {
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
  const auto values = TextReader::ToDoubles(fields.numbers);
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
    const std::optional<GpsRow> row = ParseRow(fields);
    if (!row) {
      reader.Fail("'" + std::string(reader.line()) +
                  "' is not name,latitude,longitude[,altitude[,sigma]]");
    }
    if (!row->position.IsOnEarth()) {
      reader.Fail("'" + std::string(reader.line()) +
                  "': its latitude or longitude is out of range");
    }
    if (!rows.try_emplace(std::string(fields.name), *row).second) {
      reader.Fail("'" + std::string(fields.name) + "' has a position already");
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
