#include "cairn/georegistration/georegister.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <filesystem>

#include "cairn/base/error.h"
#include "cairn/io/colmap_model.h"
#include "cairn/io/model.h"
#include "common/console_monitor.h"
#include "common/run_flags.h"
#include "global_sfm/commands.h"
#include "global_sfm/image_sizes.h"
#include "global_sfm/run_folder.h"

namespace cairn {
namespace {

constexpr char kJsonName[] = "georegistration.json";

struct GeoregisterFlags : RunFlags {
  std::string model_path;
  std::string gps_path;
  std::string image_path;
  std::string gcp_path;
  std::string output_path;
  bool overwrite = false;

  void VisitFields(OptionVisitor& v) {
    v.String(
        "model_path", model_path,
        "folder that reconstruct wrote (its largest model is taken), or a model of any format");
    v.String(
        "gps_path", gps_path,
        "file with a line an image: name latitude longitude [altitude [sigma]], blanks or commas "
        "between; degrees (WGS84), meters");
    v.String(
        "image_path", image_path,
        "folder of the photographs: their EXIF has GPS where there is no gps_path, and a Bundler "
        "model gets its image sizes from them");
    v.String("gcp_path", gcp_path,
             "ground control points, OpenDroneMap's gcp_list.txt: with three that the model has, "
             "they decide, and GPS is checked; names that begin with CHK- are of check points");
    v.String(
        "output_path", output_path,
        "folder for the model in east, north, up, meters, and georegistration.json (similarity "
        "and residuals); without it, nothing is written");
    v.Bool("overwrite", overwrite, "replace files in output_path that cairn did not write, too");
    RunFlags::VisitFields(v);
  }
};

void Describe(const Georegistration& found, ProgressMonitor& monitor) {
  for (const std::string& line : DescribeResiduals(found)) monitor.Info(line);
  for (const ResultWarning& warning : WarningsOf(found)) monitor.Warning(WarningText(warning));
  const std::string rows = std::to_string(std::ranges::count_if(
                               found.images, [](const auto& image) { return !image.is_wrong; })) +
                           " positions agree";
  monitor.Info((found.by_control_points ? "by control points" : rows) + "; " +
               fmt::format("median residual {:.3g} m, scale {:.6g} m", found.median_residual_m,
                           found.enu_from_world.scale));
}

int Run(Command&, GeoregisterFlags& flags) {
  const bool has_gps = !flags.gps_path.empty() || !flags.image_path.empty();
  if (!has_gps && flags.gcp_path.empty()) {
    throw ConfigError("gps_path", "or image_path or gcp_path is required");
  }
  ConsoleMonitor monitor;
  const RunContext run = flags.Run(monitor);
  WarnOfUnfinishedModels(flags.model_path, monitor);
  Reconstruction model = ReadModel(flags.model_path);
  CompleteImageSizes(flags.image_path, model);
  KnownPositions known;
  std::vector<std::string> names;
  for (const auto& [id, image] : model.images) names.push_back(image.image.name);
  if (has_gps) {
    known.images = ReadPositions(names, flags.gps_path, flags.image_path, run);
  }
  if (!flags.gcp_path.empty()) known.control_points = ReadControlPoints(names, flags.gcp_path, run);
  const Georegistration found = Georegister(model, known, run);
  if (found.status != GeoregistrationStatus::kOk) {
    for (const ResultWarning& warning : WarningsOf(found)) monitor.Warning(WarningText(warning));
    return kExitNoUsableResult;
  }
  Describe(found, monitor);
  if (flags.output_path.empty()) return kExitSuccess;
  model.Transform(found.enu_from_world);
  WriteColmapResult(
      model, flags.output_path,
      {.command = "georegister", .texts = {{kJsonName, GeoregistrationToJson(found)}}},
      flags.overwrite);
  monitor.Info("origin, similarity and residuals: " +
               (std::filesystem::path(flags.output_path) / kJsonName).string());
  WarnOfOtherModels(flags.model_path, "georegistered", monitor);
  return kExitSuccess;
}

}  // namespace

void AddGeoregisterCommand(Program& program) {
  AddCommand<GeoregisterFlags>(program, "georegister",
                               "Where on Earth a model is, by the positions of its photographs.",
                               {"model_path"}, Run);
}

}  // namespace cairn
