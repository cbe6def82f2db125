#include "cairn/georegistration/georegister.h"

#include <cstdio>
#include <filesystem>
#include <memory>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/base/path_in_folder.h"
#include "cairn/image/exif.h"
#include "cairn/io/colmap_model.h"
#include "cairn/io/model.h"
#include "common/console_monitor.h"
#include "global_sfm/commands.h"
#include "global_sfm/run_folder.h"

namespace cairn {
namespace {

struct GeoregisterFlags {
  std::string model_path;
  std::string gps_path;
  std::string image_path;
  std::string output_path;
  int seed = 0;
  int num_threads = 0;

  void VisitFields(OptionVisitor& v) {
    v.String(
        "model_path", model_path,
        "folder that reconstruct wrote (its largest model is taken), or a model of any format");
    v.String(
        "gps_path", gps_path,
        "file with a line an image: name latitude longitude altitude [sigma], blanks or commas "
        "between; degrees (WGS84), meters");
    v.String("image_path", image_path,
             "folder of the photographs, whose EXIF has GPS, instead of gps_path");
    v.String("output_path", output_path,
             "folder for georegistration.json and the model in east, north, up, meters");
    v.Int("seed", seed, {0, 1e9}, "seed of the random numbers");
    v.Int("num_threads", num_threads, {0, 1024}, "threads that read EXIF; 0: all");
  }
};

std::map<std::string, GpsRow> ReadExifPositions(const Reconstruction& model,
                                                const GeoregisterFlags& flags) {
  std::vector<std::string> names;
  for (const auto& [id, image] : model.images) names.push_back(image.image.name);
  std::vector<std::optional<GpsPosition>> positions(names.size());
  ParallelFor(flags.num_threads, std::ssize(names), [&](int64_t i) {
    const std::string path = PathInFolder(flags.image_path, names[i]);
    if (std::filesystem::exists(path)) positions[i] = ReadExif(path, 1, 1).gps;
  });
  std::map<std::string, GpsRow> rows;
  for (size_t i = 0; i < names.size(); ++i) {
    if (positions[i]) rows[names[i]].position = *positions[i];
  }
  return rows;
}

// Why the model has no place on Earth; "": it has one.
std::string Failure(const Georegistration& found) {
  switch (found.status) {
    case GeoregistrationStatus::kOk:
      return "";
    case GeoregistrationStatus::kTooFewImages:
      return std::to_string(found.images.size()) +
             " images of the model have a position; it takes three";
    case GeoregistrationStatus::kOnALine:
      return "the cameras, or their positions, lie on a line, about which the model may turn";
    case GeoregistrationStatus::kNoAgreement:
      return "the positions contradict the model: half of them are far off, whatever the "
             "similarity";
  }
  return "";
}

std::string Format(const char* format, double a, double b, double c) {
  char text[160];
  std::snprintf(text, sizeof(text), format, a, b, c);
  return text;
}

void Describe(const Georegistration& found, ProgressMonitor& monitor) {
  int num_wrong = 0;
  for (const GeoregisteredImage& image : found.images) {
    if (!image.is_wrong) continue;
    ++num_wrong;
    const Eigen::Vector3d off = -image.residual;
    monitor.Warning(image.name + ": its position is " +
                    Format("%.2f m east, %.2f m north, %.2f m up of where the others put it",
                           off.x(), off.y(), off.z()) +
                    "; it is not used");
  }
  if (!found.without_altitude.empty()) {
    monitor.Warning(std::to_string(found.without_altitude.size()) +
                    " positions have no altitude, such as that of " +
                    found.without_altitude.front() + "; they are not used");
  }
  if (found.roll_sigma_deg > 5) {
    monitor.Warning(
        Format("the cameras' path is nearly straight: the model may turn about it by "
               "%.0f degrees",
               found.roll_sigma_deg, 0, 0));
  }
  monitor.Info(std::to_string(found.images.size() - num_wrong) + " positions agree, " +
               std::to_string(num_wrong) + " are wrong; " +
               Format("median residual %.3g m, scale %.6g m", found.median_residual_m,
                      found.enu_from_world.scale, 0));
}

int Run(const GeoregisterFlags& flags) {
  if (flags.gps_path.empty() == flags.image_path.empty()) {
    throw ConfigError("gps_path", "or image_path is required, one of them");
  }
  ConsoleMonitor monitor;
  const std::string path = LargestModelIn(flags.model_path);
  Reconstruction model = ReadModel(path);
  const std::map<std::string, GpsRow> rows =
      flags.gps_path.empty() ? ReadExifPositions(model, flags) : ReadGpsFile(flags.gps_path);
  const Georegistration found =
      Georegister(model, rows, {.seed = static_cast<uint64_t>(flags.seed), .monitor = monitor});
  if (const std::string failure = Failure(found); !failure.empty()) {
    monitor.Warning(failure);
    return kExitNoUsableResult;
  }
  Describe(found, monitor);
  std::string folder = RunFolderOf(path);  // its models' own folders are reconstruct's
  if (folder.empty()) folder = std::filesystem::is_directory(path) ? path : ".";
  if (!flags.output_path.empty()) {
    model.Transform(found.enu_from_world);
    WriteColmapModel(model, flags.output_path);
    folder = flags.output_path;
  }
  const std::string json = (std::filesystem::path(folder) / "georegistration.json").string();
  WriteFileAtomically(json, GeoregistrationToJson(found));
  monitor.Info("origin, similarity and residuals: " + json);
  return kExitSuccess;
}

}  // namespace

void AddGeoregisterCommand(Program& program) {
  Command& command = program.AddCommand(
      "georegister", "Where on Earth a model is, by the positions of its photographs.");
  const auto flags = std::make_shared<GeoregisterFlags>();
  command.AddOptions("", *flags);
  command.SetRun([&command, flags] {
    command.Require("model_path");
    return Run(*flags);
  });
}

}  // namespace cairn
