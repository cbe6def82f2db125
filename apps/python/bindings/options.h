#pragma once

#include <pybind11/pybind11.h>

#include <string>
#include <vector>

#include "cairn/base/options.h"

namespace cairn::python {

namespace py = pybind11;

// Fields of options structs by their keys: those of flags and TOML files ("matching.max_ratio").
class OptionTable {
 public:
  // `options` must outlive the table.
  template <class Options>
  void Add(const std::string& module, Options& options) {
    AddFields(module, FieldsOf(options));
  }
  // All modules of BuildPipelineOptions or ReconstructSettings.
  template <class Settings>
  void AddModules(Settings& settings) {
    settings.VisitModules([this](const char* module, auto& options) { Add(module, options); });
  }

  // Sets what a dictionary has: {"matching.max_ratio": 0.8} or {"matching": {"max_ratio": 0.8}}, as
  // tomllib reads it; None: nothing. Throws ConfigError for keys and types that are unknown.
  void Set(const py::object& given) const;
  // The same for options that an earlier run stored, but for keys in `given`, and for what another
  // version wrote.
  void SetStored(const std::string& toml, const py::object& given) const;
  const std::vector<OptionField>& fields() const { return fields_; }  // by their whole keys

 private:
  void AddFields(const std::string& module, std::vector<OptionField> fields);
  const OptionField* Find(const std::string& key) const;
  std::vector<OptionField> fields_;
};

// The options of one module from the argument `options` of a function.
template <class Options>
Options ToOptions(const py::object& given) {
  Options options;
  OptionTable table;
  table.Add("", options);
  table.Set(given);
  return options;
}

}  // namespace cairn::python
