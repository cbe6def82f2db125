#pragma once

#include <functional>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
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

// A field that has one of several names.
struct ChoiceField {
  std::vector<std::string> names;
  std::function<std::string()> get;             // "" if the value has no name
  std::function<void(const std::string&)> set;  // of one of the names
};

struct OptionField {
  std::string name;
  std::string help;
  std::variant<bool*, int*, double*, std::string*, std::vector<double>*, ChoiceField> value;
  OptionRange range = {};
};

// Takes down the fields that VisitFields lists.
class OptionVisitor {
 public:
  void Bool(std::string_view name, bool& value, std::string_view help) { Add(name, &value, help); }
  void Int(std::string_view name, int& value, OptionRange range, std::string_view help) {
    Add(name, &value, help, range);
  }
  void Double(std::string_view name, double& value, OptionRange range, std::string_view help) {
    Add(name, &value, help, range);
  }
  void String(std::string_view name, std::string& value, std::string_view help) {
    Add(name, &value, help);
  }
  void Doubles(std::string_view name, std::vector<double>& value, std::string_view help) {
    Add(name, &value, help);
  }
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
    Add(name, std::move(field), help);
  }
  // A string that must be one of `choices`: where it is no more than a name.
  void Choice(std::string_view name, std::string& value, std::vector<std::string> choices,
              std::string_view help) {
    const auto set = [&value](const std::string& text) { value = text; };
    Add(name, ChoiceField{std::move(choices), [&value] { return value; }, set}, help);
  }

  const std::vector<OptionField>& fields() const { return fields_; }

 private:
  void Add(std::string_view name, decltype(OptionField::value) value, std::string_view help,
           OptionRange range = {}) {
    fields_.push_back({std::string(name), std::string(help), std::move(value), range});
  }
  std::vector<OptionField> fields_;
};

// The fields of `options`, which must outlive them.
template <class Options>
std::vector<OptionField> FieldsOf(Options& options) {
  OptionVisitor visitor;
  options.VisitFields(visitor);
  return visitor.fields();
}

// "<module>.<field>", or the field's name alone in the module "".
std::string OptionKey(const std::string& module, const std::string& field);

// Throws ConfigError that names the key, the value and the names unless it is one of them.
void CheckChoice(const std::string& key, const std::string& value,
                 const std::vector<std::string>& names);

// Checks every field against its range and choices; throws ConfigError that names
// "<module>.<field>", the value, and what is allowed.
void ValidateFields(const std::vector<OptionField>& fields, const std::string& module);

// TOML lines "name = value", in order. Two equal option sets give equal text, so the text also
// serves to compare stored options with present ones.
std::string DumpFields(const std::vector<OptionField>& fields);

template <class Options>
void ValidateOptions(Options options, const std::string& module) {
  ValidateFields(FieldsOf(options), module);
}

template <class Options>
std::string DumpOptions(Options options) {
  return DumpFields(FieldsOf(options));
}

// Whether an option of earlier versions that was removed had this value, and all runs have it
// today. Files of those versions may name it.
bool IsRetired(std::string_view name, std::string_view value);

// "; did you mean '<nearest>'?", the known name nearest by edit distance, or "" where none is near.
std::string DidYouMean(const std::string& name, const std::vector<std::string>& known);

// "'<key>'", with what is to be said about an option that is not `known` by this name: its new
// name, that it was removed, or which one may be meant: one of this name in another module, or the
// nearest. A key may begin with "--".
std::string DescribeUnknownOption(const std::string& key, const std::vector<std::string>& known);

}  // namespace cairn
