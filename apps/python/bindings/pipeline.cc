#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>
#include <map>

#include "arrays.h"
#include "bindings.h"
#include "cairn/base/error.h"
#include "cairn/mapper/reconstruct.h"
#include "cairn/pipeline/build_pipeline.h"
#include "common/run_flags.h"
#include "common/run_page.h"
#include "options.h"
#include "run.h"

namespace cairn::python {
namespace {

using std::filesystem::path;

// From what reconstruct makes a model; `global_sfm report` finds it where it was written.
struct ReconstructInputs {
  std::string database_path;
  std::string image_path;
  std::optional<bool> refine_intrinsics;
  RunFlags run;

  void VisitFields(OptionVisitor& v) {
    v.String("database_path", database_path, "");
    v.String("image_path", image_path, "");
    if (refine_intrinsics) v.Bool("refine_intrinsics", *refine_intrinsics, "");
    run.VisitFields(v);
  }
};

// As the programs write it beside their output.
template <class Settings>
std::string EffectiveToml(const std::string& function, const ReconstructInputs& inputs,
                          Settings& settings) {
  std::string text = "# " + function + " of Python, cairn " CAIRN_VERSION "\n";
  text += DumpOptions(inputs);
  settings.VisitModules([&](const char* module, const auto& options) {
    if (*module) text += "\n[" + std::string(module) + "]\n";
    text += DumpOptions(options);
  });
  return text;
}

py::list WarningTexts(const RunReport& report) {
  py::list texts;
  for (const ResultWarning& warning : report.warnings) texts.append(ToText(WarningText(warning)));
  return texts;
}

BuildPipelineReport BuildGraph(const path& database_path, const std::optional<path>& image_path,
                               const std::optional<path>& depth_path, const py::object& given,
                               std::optional<int> seed, int num_threads,
                               const py::object& progress) {
  BuildPipelineOptions options;
  RunFlags flags;
  OptionTable table, flag_table;
  flag_table.Add("", flags);
  table.Add("", options.inputs);
  table.AddModules(options);
  table.Set(given);
  const BuildInputs& inputs = options.inputs;
  for (const auto& [name, value] :
       {std::pair("database_path", inputs.database_path),
        std::pair("image_path", inputs.image_path), std::pair("depth_path", inputs.depth_path)}) {
    if (!value.empty()) throw ConfigError(name, "is an argument, and no option");
  }
  options.inputs.database_path = database_path.string();
  if (image_path) options.inputs.image_path = image_path->string();
  if (depth_path) options.inputs.depth_path = depth_path->string();
  // What an earlier run was told stays as it was.
  for (const std::string& toml : StoredOptions(options.inputs)) {
    table.SetStored(toml, given);
    flag_table.SetStored(toml, given);
  }
  if (seed) flags.seed = *seed;
  ValidateOptions(flags, "");
  return ResultOf({static_cast<uint64_t>(flags.seed), num_threads, progress},
                  [&](const RunContext& run) { return RunBuildPipeline(options, run); });
}

ReconstructResult MakeModels(const path& database_path, const std::optional<path>& image_path,
                             const std::optional<path>& output_path, bool overwrite, bool report,
                             std::optional<bool> refine_intrinsics, const py::object& given,
                             int seed, int num_threads, const py::object& progress) {
  const ReconstructInputs inputs = {database_path.string(),
                                    image_path ? image_path->string() : "",
                                    refine_intrinsics,
                                    {{num_threads}, seed}};
  ValidateOptions(inputs, "");
  ReconstructSettings settings;
  OptionTable table;
  table.AddModules(settings);
  table.Set(given);
  settings.refine_intrinsics = refine_intrinsics;
  if (output_path) CheckReconstructOutput(output_path->string(), overwrite);
  return ResultOf({static_cast<uint64_t>(seed), num_threads, progress}, [&](const RunContext& run) {
    const Database database(inputs.database_path, Database::Mode::kSnapshot);
    ReconstructResult result = Reconstruct(database, inputs.image_path, settings, run);
    if (!output_path || run.monitor.StopRequested()) return result;
    if (report) result.page = MakeRunPage(database, inputs.image_path, result, run);
    WriteReconstructResult(result, output_path->string(),
                           EffectiveToml("reconstruct", inputs, settings), overwrite, run);
    return result;
  });
}

// What a run tells of itself.
template <class Result>
void BindRun(py::class_<Result>& c, RunReport Result::*run) {
  c.def_property_readonly("succeeded", [run](const Result& r) { return (r.*run).Succeeded(); })
      .def_property_readonly(
          "failure", [run](const Result& r) { return ToText((r.*run).failure); },
          "'', or at which stage it failed and what can be tried.")
      .def_property_readonly(
          "warnings", [run](const Result& r) { return WarningTexts(r.*run); },
          "What is doubtful, and what can be tried.")
      .def(
          "to_dict", [run](const Result& r) { return FromJson(ToJson(r.*run)); },
          "What each stage did.");
}

void BindBuilding(py::module_& m) {
  using Report = BuildPipelineReport;
  const auto number = [](auto field) {
    return [field](const Report& report) { return report.summary.*field; };
  };
  using Summary = ViewGraphSummary;
  py::class_<Report> c(m, "BuildReport", "The result of build_view_graph.");
  BindRun(c, &Report::run);
  c.def_property_readonly("num_images", number(&Summary::num_images))
      .def_property_readonly("num_pairs", number(&Summary::num_pairs), "With matches.")
      .def_property_readonly("num_verified", number(&Summary::num_verified))
      .def_property_readonly("verified_by", number(&Summary::verified_by), "Pairs by verifier.")
      .def_property_readonly("rejected_by", number(&Summary::rejected_by), "Pairs by reason.")
      .def("__str__", [](const Report& r) { return ToText(SummaryText(r.summary, r.run)); });
  m.def("build_view_graph", &BuildGraph, py::arg("database_path"),
        py::arg("image_path") = py::none(), py::arg("depth_path") = py::none(), py::kw_only(),
        py::arg("options") = py::none(), py::arg("seed") = py::none(), py::arg("num_threads") = 0,
        py::arg("progress") = py::none(),
        R"(Photographs to features, depth, matches and verified pairs, all in one database.

What the database has is kept: features and matches that were written to it, and the results of an
earlier run, which may have been interrupted, with its seed where none is given. options: as the
flags of the program of this name, such as {"verifier": "five_point", "matching.max_ratio": 0.9}.
See ViewGraph.from_database.)");
}

void BindReconstructing(py::module_& m) {
  using Result = ReconstructResult;
  py::class_<Result> c(m, "ReconstructResult", "The result of reconstruct.");
  BindRun(c, &Result::report);
  c.def_readonly("models", &Result::models, "Reconstructions, the largest first.",
                 py::return_value_policy::reference_internal)
      .def_readonly("view_graph", &Result::graph, "All verified pairs, with reasons.",
                    py::return_value_policy::reference_internal)
      .def_property_readonly(
          "image_names",
          [](const Result& result) {
            std::map<image_t, py::str> names;
            for (const Image& image : result.images) names[image.image_id] = ToName(image.name);
            return names;
          },
          "Of all images of the database, by id.");
  m.def("reconstruct", &MakeModels, py::arg("database_path"), py::arg("image_path") = py::none(),
        py::arg("output_path") = py::none(), py::kw_only(), py::arg("overwrite") = false,
        py::arg("report") = true, py::arg("refine_intrinsics") = py::none(),
        py::arg("options") = py::none(), py::arg("seed") = 0, py::arg("num_threads") = 0,
        py::arg("progress") = py::none(),
        R"(Cameras and points from the verified pairs of a database.

image_path: the photographs, for colors; output_path: where to write all that the program
`global_sfm reconstruct` writes, report.html (unless not report) included. A failure that is to be
expected (too few pairs, ...) is told in the result.)");
}

}  // namespace

void BindPipeline(py::module_& m) {
  BindBuilding(m);
  BindReconstructing(m);
}

}  // namespace cairn::python
