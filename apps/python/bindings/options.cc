#include "options.h"

#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <functional>
#include <map>
#include <utility>

#include "arrays.h"
#include "bindings.h"
#include "cairn/base/error.h"
#include "cairn/bundle_adjustment/bundle_adjustment.h"
#include "cairn/intrinsics/focal_calibration.h"
#include "cairn/mapper/reconstruct.h"
#include "cairn/pipeline/build_pipeline.h"
#include "cairn/rotation_averaging/rotation_averaging.h"
#include "cairn/translation_averaging/options.h"
#include "cairn/two_view/options.h"
#include "cairn/view_graph/options.h"

namespace cairn::python {
namespace {

// Throws ConfigError that says what kind of value the key has.
template <class Value>
Value Cast(const std::string& key, py::handle value, const char* what) {
  try {
    return value.cast<Value>();
  } catch (const py::cast_error&) {
  } catch (const py::error_already_set&) {  // of Python's own dict()
  }
  throw ConfigError(key, "'" + FromName(py::str(value)) + "' is not " + what);
}

void Assign(const std::string& key, bool* value, py::handle given) {
  const bool is_boolean = py::isinstance<py::bool_>(given) ||
                          py::isinstance(given, py::module_::import("numpy").attr("bool_"));
  if (!is_boolean) throw ConfigError(key, "'" + FromName(py::str(given)) + "' is not a boolean");
  *value = given.cast<bool>();
}
void Assign(const std::string& key, int* value, py::handle given) {
  *value = Cast<int>(key, given, "an integer");
}
void Assign(const std::string& key, double* value, py::handle given) {
  *value = Cast<double>(key, given, "a number");
}
// Folders may be of pathlib, and have names that are no UTF-8.
std::string CastText(const std::string& key, py::handle given) {
  const bool is_name = py::isinstance<py::str>(given) || py::hasattr(given, "__fspath__");
  return is_name ? FromName(py::reinterpret_borrow<py::object>(given))
                 : Cast<std::string>(key, given, "a text");
}
void Assign(const std::string& key, std::string* value, py::handle given) {
  *value = CastText(key, given);
}
void Assign(const std::string& key, std::vector<double>* value, py::handle given) {
  *value = Cast<std::vector<double>>(key, given, "a list of numbers");
}
void Assign(const std::string& key, const ChoiceField& field, py::handle given) {
  const std::string text = CastText(key, given);
  CheckChoice(key, text, field.names);
  field.set(text);
}

void SetField(const OptionField& field, py::handle given) {
  std::visit([&](const auto& value) { Assign(field.name, value, given); }, field.value);
}

template <class Value>
py::object Get(const Value* value) {
  return py::cast(*value);
}
py::object Get(const ChoiceField& field) { return py::cast(field.get()); }

py::object GetField(const OptionField& field) {
  return std::visit([](const auto& value) { return Get(value); }, field.value);
}

// Values by whole keys, of a dictionary that may have dictionaries of modules in it.
std::vector<std::pair<std::string, py::object>> Flatten(const py::object& given) {
  std::vector<std::pair<std::string, py::object>> values;
  if (given.is_none()) return values;
  for (const auto& [key, value] : Cast<py::dict>("options", given, "a dictionary")) {
    const std::string name = py::str(key);
    if (!py::isinstance<py::dict>(value)) {
      values.emplace_back(name, py::reinterpret_borrow<py::object>(value));
      continue;
    }
    for (auto& [field, field_value] : Flatten(py::reinterpret_borrow<py::object>(value))) {
      values.emplace_back(name + "." + field, field_value);
    }
  }
  return values;
}

// The options of a function with their defaults, for as long as `use` runs.
void WithOptionsOf(const std::string& function,
                   const std::function<void(const OptionTable&)>& use) {
  const auto with = [&use]<class Options>(Options options) {
    OptionTable table;
    if constexpr (requires { options.inputs; }) table.Add("", options.inputs);
    if constexpr (requires { options.VisitFields(std::declval<OptionVisitor&>()); }) {
      table.Add("", options);
    } else {
      table.AddModules(options);
    }
    use(table);
  };
  const std::map<std::string, std::function<void()>> functions = {
      {"verify_pair", [&] { with(TwoViewOptions()); }},
      {"average_rotations", [&] { with(RotationAveragingOptions()); }},
      {"average_translations", [&] { with(TranslationAveragingOptions()); }},
      {"calibrate_focals", [&] { with(FocalCalibrationOptions()); }},
      {"adjust_bundle", [&] { with(BundleAdjustmentOptions()); }},
      {"sample_depth", [&] { with(DepthOptions()); }},
      {"ViewGraph", [&] { with(ViewGraphBuilderOptions()); }},
      {"build_view_graph", [&] { with(BuildPipelineOptions()); }},
      {"reconstruct", [&] { with(ReconstructSettings()); }}};
  std::vector<std::string> names;
  for (const auto& [name, call] : functions) names.push_back(name);
  CheckChoice("function", function, names);
  functions.at(function)();
}

py::dict DefaultOptions(const std::string& function) {
  py::dict values;
  WithOptionsOf(function, [&](const OptionTable& table) {
    for (const auto& field : table.fields()) values[py::str(field.name)] = GetField(field);
  });
  return values;
}

py::dict OptionHelp(const std::string& function) {
  py::dict texts;
  WithOptionsOf(function, [&](const OptionTable& table) {
    for (const auto& field : table.fields()) texts[py::str(field.name)] = field.help;
  });
  return texts;
}

}  // namespace

void OptionTable::AddFields(const std::string& module, std::vector<OptionField> fields) {
  for (OptionField& field : fields) {
    field.name = OptionKey(module, field.name);
    fields_.push_back(std::move(field));
  }
}

const OptionField* OptionTable::Find(const std::string& key) const {
  const auto field = std::ranges::find(fields_, key, &OptionField::name);
  return field == fields_.end() ? nullptr : &*field;
}

void OptionTable::Set(const py::object& given) const {
  for (const auto& [key, value] : Flatten(given)) {
    if (const OptionField* field = Find(key)) {
      SetField(*field, value);
      continue;
    }
    std::vector<std::string> known;
    for (const OptionField& field : fields_) known.push_back(field.name);
    throw ConfigError("options", "unknown key " + DescribeUnknownOption(key, known));
  }
}

void OptionTable::SetStored(const std::string& toml, const py::object& given) const {
  const py::dict values = py::module_::import("tomllib").attr("loads")(toml);
  std::map<std::string, py::object> set;
  for (const auto& [key, value] : Flatten(given)) set[key] = value;
  for (const auto& [key, value] : Flatten(values)) {
    const OptionField* field = Find(key);
    if (!field || set.contains(key)) continue;
    try {
      SetField(*field, value);
    } catch (const ConfigError&) {
      // No value of today; the stage itself says so where it matters.
    }
  }
}

void BindOptions(py::module_& m) {
  m.def("default_options", &DefaultOptions, py::arg("function"),
        "The options of a function, such as 'reconstruct', with their default values. Its argument "
        "`options` is a dictionary with some of these keys, which are those of flags and TOML "
        "files.");
  m.def("option_help", &OptionHelp, py::arg("function"), "What each option of a function means.");
}

}  // namespace cairn::python
