#include "cairn/mapper/reconstruct.h"

#include <spdlog/spdlog.h>

#include <memory>

#include "common/console_monitor.h"
#include "common/run_flags.h"
#include "global_sfm/commands.h"

namespace cairn {
namespace {

struct ReconstructFlags {
  std::string database_path;
  std::string image_path;
  std::string output_path;
  bool overwrite = false;
  bool refine_intrinsics = true;
  RunFlags run;

  void VisitFields(OptionVisitor& v) {
    v.String("database_path", database_path, "database with verified pairs");
    v.String("image_path", image_path,
             "folder of the photographs, for colors; without, points are black");
    v.String("output_path", output_path, "folder for the results, made if absent");
    v.Bool("overwrite", overwrite, "replace models in output_path that cairn did not write");
    v.Bool("refine_intrinsics", refine_intrinsics,
           "refine focal lengths and distortions; not given: 0 for cameras given by "
           "--camera_params or calibrated otherwise, else 1");
    run.VisitFields(v);
  }
};

// What the run function needs; it owns the options that the command binds.
struct State {
  ReconstructFlags flags;
  ReconstructSettings settings;
};

int Run(const Command& command, State& state) {
  for (const char* key : {"database_path", "output_path"}) command.Require(key);
  const ReconstructFlags& flags = state.flags;
  ReconstructSettings& settings = state.settings;
  if (command.IsSet("refine_intrinsics")) settings.refine_intrinsics = flags.refine_intrinsics;

  // A folder that cannot or must not be written to is noticed before the work, not after it.
  CheckReconstructOutput(flags.output_path, flags.overwrite);
  ConsoleMonitor monitor;
  const Database database(flags.database_path, Database::Mode::kReadOnly);
  ReconstructResult result =
      Reconstruct(database, flags.image_path, settings, flags.run.Run(monitor));
  const std::string report_path =
      WriteReconstructResult(result, flags.output_path, command.EffectiveToml(), flags.overwrite);
  spdlog::info("stages:\n{}", Summary(result.report));
  if (!result.report.Succeeded()) {
    spdlog::error("{}", result.report.failure);
    spdlog::error("{} says what each stage did", report_path);
    return kExitNoUsableResult;
  }
  for (size_t k = 0; k < result.models.size(); ++k) {
    const Reconstruction& model = result.models[k];
    spdlog::info("{}/sparse/{}: {} of {} images, {} points, mean reprojection error {:.3f} px",
                 flags.output_path, k, model.images.size(), result.images.size(),
                 model.points3D.size(), model.MeanReprojectionErrorPx());
  }
  for (const std::string& warning : result.report.warnings) spdlog::warn("{}", warning);
  return kExitSuccess;
}

}  // namespace

void AddReconstructCommand(Program& program) {
  Command& command = program.AddCommand(
      "reconstruct", "Cameras and points from the verified pairs of a database.");
  auto state = std::make_shared<State>();
  command.AddOptions("", state->flags);
  state->settings.VisitModules(
      [&](const char* module, auto& options) { command.AddOptions(module, options); });
  command.SetRun([&command, state] { return Run(command, *state); });
}

}  // namespace cairn
