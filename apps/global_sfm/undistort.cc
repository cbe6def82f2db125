#include "cairn/undistortion/undistort.h"

#include "cairn/io/model.h"
#include "common/console_monitor.h"
#include "common/run_flags.h"
#include "global_sfm/commands.h"
#include "global_sfm/image_sizes.h"
#include "global_sfm/run_folder.h"

namespace cairn {
namespace {

struct UndistortFlags : ThreadFlags {
  std::string model_path;
  std::string image_path;
  std::string output_path;
  DenseLayout output_type = DenseLayout::kColmap;
  bool overwrite = false;
  UndistortOptions undistort;

  void VisitFields(OptionVisitor& v) {
    v.String(
        "model_path", model_path,
        "folder that reconstruct wrote (its largest model is taken), or a model of any format");
    v.String("image_path", image_path, "folder of the photographs");
    v.String("output_path", output_path, "folder to write into, created if absent");
    v.Choice("output_type", output_type, kDenseLayouts,
             "colmap: images, sparse and stereo, for COLMAP's dense stereo and OpenMVS; 3dgs: "
             "images and sparse/0, for 3D Gaussian splatting");
    v.Bool("overwrite", overwrite, "replace files in output_path that cairn did not write, too");
    ThreadFlags::VisitFields(v);
    undistort.VisitFields(v);
  }
};

// Photographs that are left out, by name, with the reasons: a line for each of the first.
void WarnOfFailed(const std::map<std::string, std::string>& failed, ProgressMonitor& monitor) {
  constexpr size_t kMaxShown = 10;
  size_t num_shown = 0;
  for (const auto& [name, reason] : failed) {
    if (num_shown == kMaxShown) break;
    monitor.Warning(name + ": " + reason + "; left out");
    ++num_shown;
  }
  const size_t num_more = failed.size() - num_shown;
  if (num_more > 0) {
    monitor.Warning("... and " + std::to_string(num_more) + " more photographs; left out");
  }
}

int Run(Command& command, UndistortFlags& flags) {
  ConsoleMonitor monitor;
  WarnOfUnfinishedModels(flags.model_path, monitor);
  const std::string model_path = ModelsIn(flags.model_path).front();
  Reconstruction model = ReadModel(model_path);
  CompleteImageSizes(flags.image_path, model);
  const UndistortJob job{.image_path = flags.image_path,
                         .output_path = flags.output_path,
                         .model_path = model_path,
                         .layout = flags.output_type,
                         .overwrites = flags.overwrite,
                         .effective_toml = command.EffectiveToml()};
  const UndistortReport report = UndistortImages(model, job, flags.undistort, flags.Run(monitor));
  WarnOfFailed(report.failed, monitor);
  const int num_images = report.num_written + report.num_kept;
  monitor.Info(std::to_string(num_images) + " of " + std::to_string(model.images.size()) +
               " images undistorted in " + flags.output_path + ", " +
               std::to_string(report.num_kept) + " of them by an earlier run");
  WarnOfOtherModels(flags.model_path, "undistorted", monitor);
  if (report.was_stopped) monitor.Info("stopped; the same command continues");
  return report.was_stopped || num_images == 0 ? kExitNoUsableResult : kExitSuccess;
}

}  // namespace

void AddUndistortCommand(Program& program) {
  AddCommand<UndistortFlags>(
      program, "undistort",
      "Pinhole images and their model, for dense stereo and Gaussian splatting.",
      {"model_path", "image_path", "output_path"}, Run);
}

}  // namespace cairn
