#pragma once

#include <initializer_list>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

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
  // A string that must be one of `choices`.
  virtual void Choice(std::string_view name, std::string& value,
                      const std::vector<std::string>& choices, std::string_view help) = 0;
};

// Checks every field of an options struct against its range and choices; throws ConfigError that
// names
// "<module>.<field>", the value, and what is allowed.
class OptionValidator : public OptionVisitor {
 public:
  explicit OptionValidator(std::string module) : module_(std::move(module)) {}
  void Bool(std::string_view name, bool& value, std::string_view help) override;
  void Int(std::string_view name, int& value, OptionRange range, std::string_view help) override;
  void Double(std::string_view name, double& value, OptionRange range,
              std::string_view help) override;
  void String(std::string_view name, std::string& value, std::string_view help) override;
  void Doubles(std::string_view name, std::vector<double>& value, std::string_view help) override;
  void Choice(std::string_view name, std::string& value, const std::vector<std::string>& choices,
              std::string_view help) override;

 private:
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
  void Choice(std::string_view name, std::string& value, const std::vector<std::string>& choices,
              std::string_view help) override;
  const std::string& text() const { return text_; }

 private:
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

// Of an option of earlier versions that was taken out: the value that all runs have today. "" for
// other names. Files and databases of those versions may name it.
std::string RetiredValue(std::string_view name);

// The candidate nearest to `name` by edit distance, or "" if none is near: for "did you mean".
std::string NearestName(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace cairn
