#include "cairn/base/options.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "base/text.h"
#include "cairn/base/error.h"

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
      text += Formatted("\\u%04X", static_cast<unsigned>(c));
    } else {
      text += c;
    }
  }
  return text + "\"";
}

// Numbers and bounds as messages show them.
std::string FormatInt(double value) {
  return std::isinf(value) ? FormatDouble(value) : std::to_string(static_cast<int64_t>(value));
}

template <class Format>
void CheckRange(const std::string& key, double value, OptionRange range, Format format) {
  if (value >= range.min && value <= range.max) return;  // Also refuses NaN.
  throw ConfigError(key, format(value) + " is out of range [" + format(range.min) + ", " +
                             format(range.max) + "]");
}

std::string TomlValue(const bool* value) { return *value ? "true" : "false"; }
std::string TomlValue(const int* value) { return std::to_string(*value); }
std::string TomlValue(const double* value) { return FormatDouble(*value); }
std::string TomlValue(const std::string* value) { return Quote(*value); }
std::string TomlValue(const ChoiceField& field) { return Quote(field.get()); }
std::string TomlValue(const std::vector<double>* values) {
  std::string text = "[";
  for (const double v : *values) text += (text.size() > 1 ? ", " : "") + FormatDouble(v);
  return text + "]";
}

}  // namespace

void CheckChoice(const std::string& key, const std::string& value,
                 const std::vector<std::string>& names) {
  if (std::find(names.begin(), names.end(), value) != names.end()) return;
  std::string allowed;
  for (const std::string& name : names) allowed += (allowed.empty() ? "" : ", ") + name;
  throw ConfigError(key, "'" + value + "' is not one of " + allowed);
}

std::string OptionKey(const std::string& module, const std::string& field) {
  return module.empty() ? field : module + "." + field;
}

void ValidateFields(const std::vector<OptionField>& fields, const std::string& module) {
  for (const OptionField& field : fields) {
    const std::string key = OptionKey(module, field.name);
    if (const auto* number = std::get_if<int*>(&field.value)) {
      CheckRange(key, **number, field.range, FormatInt);
    } else if (const auto* number = std::get_if<double*>(&field.value)) {
      CheckRange(key, **number, field.range, FormatDouble);
    } else if (const auto* numbers = std::get_if<std::vector<double>*>(&field.value)) {
      for (const double v : **numbers) CheckRange(key, v, {}, FormatDouble);
    } else if (const auto* choice = std::get_if<ChoiceField>(&field.value)) {
      CheckChoice(key, choice->get(), choice->names);
    }
  }
}

std::string DumpFields(const std::vector<OptionField>& fields) {
  std::string text;
  for (const OptionField& field : fields) {
    const auto value = [](const auto& v) { return TomlValue(v); };
    text += field.name + " = " + std::visit(value, field.value) + "\n";
  }
  return text;
}

namespace {

// Of an option of earlier versions that was removed: the value that all runs have today, "*" where
// it never mattered. "" for other names.
std::string RetiredValue(std::string_view name) {
  static constexpr std::pair<std::string_view, std::string_view> kRetired[] = {
      {"verification.depth_solver", "proposed"},
      {"verification.local_optimization", "threshold"},
      {"tracks.conflicts", "split"},
      {"rotation_averaging.kernel", "geman_mcclure"},
      {"rotation_averaging.num_threads", "*"},  // --num_threads always overruled it
      {"translation_averaging.method", "chordal"},
      {"view_graph.filter_weak_bridges", "*"},  // of hardly any
      {"view_graph.min_bridge_inliers", "*"},
      {"bundle_adjustment.max_dense_images", "*"},  // on cairn's own solver
      {"bundle_adjustment.max_sparse_images", "*"},
      {"verbose", "*"},
      {"verification.max_num_refined", "60"},
      {"reconstruct.coarse_tracks_per_image", "500"},
      {"reconstruct.coarse_error_factor", "8"},
      {"reconstruct.min_gain", "0.005"},
      {"view_graph.filter_triplets", "true"},
      {"translation_averaging.filter_directions", "true"},
      {"translation_averaging.use_points", "true"},
      {"translation_averaging.min_spread", "0"},
  };
  for (const auto& [retired, value] : kRetired) {
    if (retired == name) return std::string(value);
  }
  return "";
}

// The known name nearest by edit distance; "" where none is near.
std::string Nearest(const std::string& name, const std::vector<std::string>& known) {
  std::string nearest;
  size_t least_distance = std::max<size_t>(2, name.size() / 3) + 1;
  for (const std::string& candidate : known) {
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
    if (row.back() < least_distance) {
      least_distance = row.back();
      nearest = candidate;
    }
  }
  return nearest;
}

// The name of an option without its module and dashes: all but the module may be right.
std::string_view FieldOf(std::string_view key) {
  return key.substr(key.find_last_of(".-") + 1);  // 0 where there is neither
}

// "; did you mean 'a' or 'b'?"
std::string Question(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) {
    text += (text.empty() ? "; did you mean '" : " or '") + name + "'";
  }
  return text.empty() ? "" : text + "?";
}

// Of all modules' options of this name, the nearest, or where none is near, a few.
std::vector<std::string> OfOtherModules(const std::string& key,
                                        const std::vector<std::string>& known) {
  constexpr size_t kFew = 3;
  std::vector<std::string> names;
  for (const std::string& name : known) {
    if (FieldOf(name) == FieldOf(key)) names.push_back(name);
  }
  if (const std::string nearest = Nearest(key, names); !nearest.empty()) return {nearest};
  if (names.size() > kFew) names.clear();
  return names;
}

}  // namespace

bool IsRetired(std::string_view name, std::string_view value) {
  const std::string retired = RetiredValue(name);
  return !retired.empty() && (retired == "*" || retired == value || Quote(retired) == value);
}

std::string DidYouMean(const std::string& name, const std::vector<std::string>& known) {
  const std::string nearest = Nearest(name, known);
  return nearest.empty() ? "" : Question({nearest});
}

std::string DescribeUnknownOption(const std::string& key, const std::vector<std::string>& known) {
  const size_t dashes = key.starts_with("--") ? 2 : 0;
  constexpr std::pair<std::string_view, std::string_view> kRenamed[] = {
      {"reconstruct.separate_twins", "reconstruct.separate_duplicates"},
      // Of thresholds twice as large, so that stages of before do not go on with another threshold.
      {"verification.rough_error_ratio", "verification.rough_error_factor"}};
  for (const auto& [old_name, name] : kRenamed) {
    if (key.substr(dashes) != old_name) continue;
    return "'" + key + "' is now '" + key.substr(0, dashes) + std::string(name) + "'";
  }
  if (const std::string value = RetiredValue(key.substr(dashes)); !value.empty()) {
    return "'" + key + "': this option was removed; it " +
           (value == "*" ? "changed no result" : "is always '" + value + "'");
  }
  if (key.substr(dashes) == "image_list_path") {
    return "'" + key +
           "': all photographs of image_path and its sub-folders are taken; put links to those of "
           "the list into a folder of their own";
  }
  const std::vector<std::string> names = OfOtherModules(key, known);
  return "'" + key + "'" + (names.empty() ? DidYouMean(key, known) : Question(names));
}

}  // namespace cairn
