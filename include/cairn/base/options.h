#pragma once

#include <functional>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "cairn/base/named_value.h"

namespace cairn {

// Every module has one options struct: defaults in place, and one method
//
//   struct MatchingOptions {
//     double max_ratio = 0.8;
//     bool cross_check = true;
//     void VisitFields(OptionVisitor& v) {
//       v.Double("max_ratio", max_ratio, {0.0, 1.0}, "largest ratio of best to second distance");
//       v.Bool("cross_check", cross_check, "keep only mutual best matches");
//     }
//   };
//
// that lists its fields. This list alone drives TOML files, command-line flags, --help, validation,
// and the dump of the options in force, so nothing is named twice (src/STYLE.md, "Options").
// A field of module `matching` is `matching.max_ratio` everywhere.
struct OptionRange {
  double min = -std::numeric_limits<double>::infinity();
  double max = std::numeric_limits<double>::infinity();
};

// A field that has one of several names, as visitors see it.
struct ChoiceField {
  std::vector<std::string> names;
  std::function<std::string()> get;             // "" if the value has no name
  std::function<void(const std::string&)> set;  // of one of the names
};

class OptionVisitor {
 public:
  virtual ~OptionVisitor() = default;
  virtual void Bool(std::string_view name, bool& value, std::string_view help) = 0;
  virtual void Int(std::string_view name, int& value, OptionRange range, std::string_view help) = 0;
  virtual void Double(std::string_view name, double& value, OptionRange range,
                      std::string_view help) = 0;
  virtual void String(std::string_view name, std::string& value, std::string_view help) = 0;
  virtual void Doubles(std::string_view name, std::vector<double>& value,
                       std::string_view help) = 0;
  // One of the values that `table` names; users write the name.
  template <class Enum>
  requires std::is_enum_v<Enum>
  void Choice(std::string_view name, Enum& value,
              std::type_identity_t<std::span<const NamedValue<Enum>>> table,
              std::string_view help) {
    ChoiceField field;
    for (const NamedValue<Enum>& entry : table) field.names.emplace_back(entry.name);
    field.get = [&value, table] { return std::string(NameOf(table, value)); };
    field.set = [&value, table](const std::string& text) {
      for (const NamedValue<Enum>& entry : table) {
        if (entry.name == text) value = entry.value;
      }
    };
    Choice(name, field, help);
  }
  // A string that must be one of `choices`: where it is no more than a name.
  void Choice(std::string_view name, std::string& value, std::vector<std::string> choices,
              std::string_view help) {
    const auto set = [&value](const std::string& text) { value = text; };
    Choice(name, ChoiceField{std::move(choices), [&value] { return value; }, set}, help);
  }

 protected:
  virtual void Choice(std::string_view name, const ChoiceField& field, std::string_view help) = 0;
};

// Throws ConfigError that names the key, the value and the names unless it is one of them.
void CheckChoice(const std::string& key, const std::string& value,
                 const std::vector<std::string>& names);

// Checks every field of an options struct against its range and choices; throws ConfigError that
// names "<module>.<field>", the value, and what is allowed.
class OptionValidator : public OptionVisitor {
 public:
  explicit OptionValidator(std::string module) : module_(std::move(module)) {}
  void Bool(std::string_view name, bool& value, std::string_view help) override;
  void Int(std::string_view name, int& value, OptionRange range, std::string_view help) override;
  void Double(std::string_view name, double& value, OptionRange range,
              std::string_view help) override;
  void String(std::string_view name, std::string& value, std::string_view help) override;
  void Doubles(std::string_view name, std::vector<double>& value, std::string_view help) override;

 private:
  void Choice(std::string_view name, const ChoiceField& field, std::string_view help) override;
  std::string Key(std::string_view name) const;
  std::string module_;
};

// Writes the fields as TOML lines "name = value", in order. Two equal option sets give equal text,
// so the text also serves to compare stored options with present ones.
class OptionDumper : public OptionVisitor {
 public:
  void Bool(std::string_view name, bool& value, std::string_view help) override;
  void Int(std::string_view name, int& value, OptionRange range, std::string_view help) override;
  void Double(std::string_view name, double& value, OptionRange range,
              std::string_view help) override;
  void String(std::string_view name, std::string& value, std::string_view help) override;
  void Doubles(std::string_view name, std::vector<double>& value, std::string_view help) override;
  const std::string& text() const { return text_; }

 private:
  void Choice(std::string_view name, const ChoiceField& field, std::string_view help) override;
  void Line(std::string_view name, const std::string& value);
  std::string text_;
};

template <class Options>
void ValidateOptions(Options options, const std::string& module) {
  OptionValidator validator(module);
  options.VisitFields(validator);
}

template <class Options>
std::string DumpOptions(Options options) {
  OptionDumper dumper;
  options.VisitFields(dumper);
  return dumper.text();
}

// Of an option of earlier versions that was removed: the value that all runs have today, "*"
// where it never mattered. "" for other names. Files of those versions may name it.
std::string RetiredValue(std::string_view name);

// Today's name of an option of earlier versions; "" for other names.
std::string NewNameOf(std::string_view name);

// The candidate nearest to `name` by edit distance, or "" if none is near: for "did you mean".
std::string NearestName(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace cairn
