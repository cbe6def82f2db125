#include "cairn/mapper/reconstruct.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <set>

#include "cairn/base/file.h"
#include "cairn/io/model.h"
#include "common/console_monitor.h"
#include "common/run_flags.h"
#include "common/run_page.h"
#include "global_sfm/commands.h"
#include "global_sfm/describe_result.h"
#include "global_sfm/run_folder.h"

namespace cairn {
namespace {

struct ReconstructFlags {
  std::string database_path;
  std::string image_path;
  std::string output_path;
  std::string input_path;
  bool overwrite = false;
  bool refine_intrinsics = true;
  bool report = true;
  RunFlags run;

  void VisitFields(OptionVisitor& v) {
    v.String("database_path", database_path, "database with verified pairs");
    v.String("image_path", image_path,
             "folder of the photographs, for colors; without, points are black");
    v.String("output_path", output_path, "folder for the results, made if absent");
    v.String("input_path", input_path,
             "model to go on from, of this or another program, or folder of several: its poses "
             "and cameras are refined, and (reconstruct) images that it lacks registered; without, "
             "reconstruct begins from nothing");
    v.Bool("overwrite", overwrite, "replace models in output_path that cairn did not write");
    v.Bool("refine_intrinsics", refine_intrinsics,
           "refine focal lengths and distortions; not given: 0 for cameras given by "
           "--camera_params or calibrated otherwise, else 1");
    v.Bool("report", report, "write report.html, a page for the browser that shows the result");
    run.VisitFields(v);
  }
};

// What the run function needs; it owns the options that the command binds.
struct State {
  std::string name;  // of the command
  bool needs_input = false;
  ReconstructFlags flags{};
  ReconstructSettings settings{};
};

// The earlier model that a model has the most images of.
size_t BeginningOf(const Reconstruction& model, const std::vector<Reconstruction>& earlier) {
  std::set<std::string> names;
  for (const auto& [id, image] : model.images) names.insert(image.image.name);
  const auto num_common = [&](const Reconstruction& other) {
    return std::ranges::count_if(
        other.images, [&](const auto& entry) { return names.contains(entry.second.image.name); });
  };
  return std::ranges::max_element(earlier, {}, num_common) - earlier.begin();
}

// A model that goes on from an earlier one keeps its frame, and so its place on Earth.
void KeepPlaces(const std::string& input_path, const std::vector<Reconstruction>& earlier,
                ReconstructResult& result) {
  const std::vector<std::string> folders = ModelsIn(input_path);
  result.georegistrations.resize(result.models.size());
  for (size_t k = 0; k < result.models.size(); ++k) {
    if (!result.georegistrations[k].empty() || !result.keeps_frame[k]) continue;
    const std::string place =
        folders[BeginningOf(result.models[k], earlier)] + "/georegistration.json";
    if (std::filesystem::exists(place)) result.georegistrations[k] = PlaceAlone(ReadFile(place));
  }
}

int Run(const Command& command, State& state) {
  for (const char* key : {"database_path", "output_path"}) command.Require(key);
  if (state.needs_input) command.Require("input_path");
  const ReconstructFlags& flags = state.flags;
  ReconstructSettings& settings = state.settings;
  if (command.IsSet("refine_intrinsics")) settings.refine_intrinsics = flags.refine_intrinsics;

  ConsoleMonitor monitor;
  const Database database(flags.database_path, Database::Mode::kSnapshot);
  // A folder that cannot or must not be written to is noticed before the work, not after it.
  CheckReconstructOutput(flags.output_path, flags.overwrite);
  const RunContext run = flags.run.Run(monitor);
  std::vector<Reconstruction> earlier;
  if (!flags.input_path.empty()) {
    WarnOfUnfinishedModels(flags.input_path, monitor);
    earlier = ReadModels(flags.input_path);
  }
  ReconstructResult result = Reconstruct(database, flags.image_path, settings, run, earlier);
  if (!earlier.empty()) KeepPlaces(flags.input_path, earlier, result);
  result.report.program = "global_sfm " + state.name;
  // (A run that is stopped has a second to write what there is.)
  const bool leaves_page_out = flags.report && monitor.StopRequested();
  if (flags.report && !leaves_page_out) {
    result.page = MakeRunPage(database, flags.image_path, result, run);
  }
  // It means something of its own where it is not given.
  std::vector<std::string> left_out;
  if (!command.IsSet("refine_intrinsics")) left_out.push_back("refine_intrinsics");
  const std::string report_path = WriteReconstructResult(
      result, flags.output_path, command.EffectiveToml(left_out), flags.overwrite, run);
  const std::string folder = std::filesystem::path(report_path).parent_path().string();
  std::fputs(DescribeResult(result, folder, run).c_str(), stdout);
  if (result.report.Succeeded() && leaves_page_out) {
    spdlog::error("stopped by the user before report.html was made; global_sfm report makes it");
    return kExitNoUsableResult;
  }
  if (result.report.Succeeded()) return kExitSuccess;
  spdlog::error("{}", result.report.failure);
  return kExitNoUsableResult;
}

void AddCommand(Program& program, std::shared_ptr<State> state, const std::string& description) {
  Command& command = program.AddCommand(state->name, description);
  command.AddOptions("", state->flags);
  state->settings.VisitModules(
      [&](const char* module, auto& options) { command.AddOptions(module, options); });
  command.SetRun([&command, state] { return Run(command, *state); });
}

}  // namespace

void AddReconstructCommand(Program& program) {
  AddCommand(program, std::make_shared<State>(State{"reconstruct"}),
             "Cameras and points from the verified pairs of a database.");
}

// Goes on from a model, as `reconstruct --input_path` does, and registers nothing.
void AddRefineCommand(Program& program) {
  auto state = std::make_shared<State>(State{"refine", true});
  state->settings.reconstruct.register_left_out = false;
  AddCommand(program, state,
             "Refines a model of any program: its poses and cameras are adjusted with points from "
             "the matches of the database, its images and its frame stay.");
}

}  // namespace cairn
