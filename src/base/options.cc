#include "cairn/base/options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <numeric>

#include "cairn/base/error.h"
#include "cairn/base/unknown_option.h"

namespace cairn {
namespace {

// The shortest text that reads back as the same number; always with a point or exponent, as TOML
// wants.
std::string FormatDouble(double value) {
  if (std::isinf(value)) return value > 0 ? "inf" : "-inf";
  if (std::isnan(value)) return "nan";
  char buffer[32];
  const auto result = std::to_chars(buffer, buffer + sizeof(buffer), value);
  std::string text(buffer, result.ptr);
  if (text.find_first_of(".e") == std::string::npos) text += ".0";
  return text;
}

// A TOML basic string.
std::string Quote(std::string_view value) {
  std::string text = "\"";
  for (const char c : value) {
    if (c == '"' || c == '\\') {
      text += {'\\', c};
    } else if (c == '\n') {
      text += "\\n";
    } else if (c == '\t') {
      text += "\\t";
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      char buffer[8];
      std::snprintf(buffer, sizeof(buffer), "\\u%04X", static_cast<unsigned>(c));
      text += buffer;
    } else {
      text += c;
    }
  }
  return text + "\"";
}

// `format` writes a bound or value: integers without a point, though ranges are doubles.
void CheckRange(const std::string& key, double value, OptionRange range,
                std::string (*format)(double)) {
  if (value >= range.min && value <= range.max) return;  // Also refuses NaN.
  throw ConfigError(key, format(value) + " is out of range [" + format(range.min) + ", " +
                             format(range.max) + "]");
}

std::string FormatInt(double value) {
  return std::isinf(value) ? FormatDouble(value) : std::to_string(static_cast<int64_t>(value));
}

}  // namespace

void CheckChoice(const std::string& key, const std::string& value,
                 const std::vector<std::string>& names) {
  if (std::find(names.begin(), names.end(), value) != names.end()) return;
  std::string allowed;
  for (const std::string& name : names) allowed += (allowed.empty() ? "" : ", ") + name;
  throw ConfigError(key, "'" + value + "' is not one of " + allowed);
}

std::string OptionValidator::Key(std::string_view name) const {
  return module_.empty() ? std::string(name) : module_ + "." + std::string(name);
}
void OptionValidator::Bool(std::string_view, bool&, std::string_view) {}
void OptionValidator::Int(std::string_view name, int& value, OptionRange range, std::string_view) {
  CheckRange(Key(name), value, range, FormatInt);
}
void OptionValidator::Double(std::string_view name, double& value, OptionRange range,
                             std::string_view) {
  CheckRange(Key(name), value, range, FormatDouble);
}
void OptionValidator::String(std::string_view, std::string&, std::string_view) {}
void OptionValidator::Doubles(std::string_view name, std::vector<double>& value, std::string_view) {
  for (const double v : value) CheckRange(Key(name), v, {}, FormatDouble);
}
void OptionValidator::Choice(std::string_view name, const ChoiceField& field, std::string_view) {
  CheckChoice(Key(name), field.get(), field.names);
}

void OptionDumper::Line(std::string_view name, const std::string& value) {
  text_ += std::string(name) + " = " + value + "\n";
}
void OptionDumper::Bool(std::string_view name, bool& value, std::string_view) {
  Line(name, value ? "true" : "false");
}
void OptionDumper::Int(std::string_view name, int& value, OptionRange, std::string_view) {
  Line(name, std::to_string(value));
}
void OptionDumper::Double(std::string_view name, double& value, OptionRange, std::string_view) {
  Line(name, FormatDouble(value));
}
void OptionDumper::String(std::string_view name, std::string& value, std::string_view) {
  Line(name, Quote(value));
}
void OptionDumper::Doubles(std::string_view name, std::vector<double>& value, std::string_view) {
  std::string text = "[";
  for (const double v : value) text += (text.size() > 1 ? ", " : "") + FormatDouble(v);
  Line(name, text + "]");
}
void OptionDumper::Choice(std::string_view name, const ChoiceField& field, std::string_view) {
  Line(name, Quote(field.get()));
}

std::string RetiredValue(std::string_view name) {
  static constexpr std::pair<std::string_view, std::string_view> kRetired[] = {
      {"verification.depth_solver", "proposed"},
      {"verification.local_optimization", "threshold"},
      {"tracks.conflicts", "split"},
      {"rotation_averaging.kernel", "geman_mcclure"},
      {"rotation_averaging.num_threads", "*"},  // --num_threads always overruled it
      {"translation_averaging.method", "chordal"},
  };
  for (const auto& [retired, value] : kRetired) {
    if (retired == name) return std::string(value);
  }
  return "";
}

std::string NewNameOf(std::string_view name) {
  return name == "reconstruct.separate_twins" ? "reconstruct.separate_duplicates" : "";
}

std::string NearestName(std::string_view name, const std::vector<std::string>& candidates) {
  std::string best;
  size_t best_distance = std::max<size_t>(2, name.size() / 3) + 1;
  for (const std::string& candidate : candidates) {
    std::vector<size_t> row(candidate.size() + 1);  // Levenshtein distance, one row at a time.
    std::iota(row.begin(), row.end(), size_t{0});
    for (size_t i = 1; i <= name.size(); ++i) {
      size_t diagonal = row[0];
      row[0] = i;
      for (size_t j = 1; j <= candidate.size(); ++j) {
        const size_t replace = diagonal + (name[i - 1] != candidate[j - 1]);
        diagonal = row[j];
        row[j] = std::min({replace, row[j] + 1, row[j - 1] + 1});
      }
    }
    if (row.back() < best_distance) {
      best_distance = row.back();
      best = candidate;
    }
  }
  return best;
}

std::string DidYouMean(const std::string& name, const std::vector<std::string>& known) {
  const std::string nearest = NearestName(name, known);
  return nearest.empty() ? "" : "; did you mean '" + nearest + "'?";
}

std::string DescribeUnknownOption(const std::string& key, const std::vector<std::string>& known) {
  const size_t dashes = key.starts_with("--") ? 2 : 0;
  if (const std::string name = NewNameOf(key.substr(dashes)); !name.empty()) {
    return "'" + key + "' is now '" + key.substr(0, dashes) + name + "'";
  }
  if (const std::string value = RetiredValue(key.substr(dashes)); !value.empty()) {
    return "'" + key + "': this option was removed; it " +
           (value == "*" ? "had no effect" : "is always '" + value + "'");
  }
  return "'" + key + "'" + DidYouMean(key, known);
}

}  // namespace cairn
