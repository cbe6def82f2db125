#include <algorithm>
#include <filesystem>

#include "base/output_folder.h"
#include "cairn/base/file.h"
#include "cairn/io/bundler.h"
#include "cairn/io/colmap_model.h"
#include "cairn/io/gltf.h"
#include "cairn/io/model.h"
#include "cairn/io/ply.h"
#include "cairn/io/transforms_json.h"
#include "common/console_monitor.h"
#include "common/run_flags.h"
#include "global_sfm/commands.h"
#include "global_sfm/image_sizes.h"
#include "global_sfm/one_dsfm_export.h"
#include "global_sfm/run_folder.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

struct ExportFlags : ThreadFlags {
  std::string model_path;
  std::string model_list;
  std::string output_path;
  std::string output_type = "colmap_bin";
  std::string image_path;
  std::string database_path;
  bool overwrite = false;
  void VisitFields(OptionVisitor& v) {
    v.String("model_path", model_path,
             "folder that reconstruct wrote (its largest model is taken), COLMAP model folder "
             "(binary or text), Bundler file (.out) or folder of .camera files");
    v.String("model_list", model_list,
             "list of a Bundler model's images; default: list.txt beside it");
    v.String("output_path", output_path,
             "folder to write into, created if absent; for ply, gltf and nerfstudio also a file");
    v.Choice("output_type", output_type,
             {"colmap_bin", "colmap_txt", "bundler", "ply", "gltf", "nerfstudio", "1dsfm"},
             "what to write: a COLMAP model, bundle.out with list.txt, points.ply (with camera "
             "frusta), model.glb (the same as glTF), transforms.json with points.ply, or a 1DSfM "
             "data set with photographs");
    v.String("image_path", image_path,
             "folder of the photographs, which nerfstudio's file refers to (default: images), and "
             "1dsfm resamples; a Bundler model gets its image sizes from them");
    v.String("database_path", database_path, "database of the model, whose pairs 1dsfm writes");
    v.Bool("overwrite", overwrite,
           "replace files in output_path that cairn did not write, too (COLMAP models; other types "
           "always replace these, and by this flag results of other commands)");
    ThreadFlags::VisitFields(v);
  }
};

// Files in a folder that are to be written.
void CheckReplaced(const ExportFlags& flags, const std::string& folder,
                   const std::vector<std::string>& files) {
  if (!flags.overwrite) CheckNotOfAnother(folder, "export", files);
}

// `path` itself if it ends in the extension, else `name` in the folder `path`.
std::string FileIn(const ExportFlags& flags, const std::string& extension,
                   const std::string& name) {
  const fs::path path = flags.output_path;
  const bool is_file = flags.output_path.ends_with(extension);
  const fs::path file = is_file ? path : path / name;
  const std::string folder = file.parent_path().string();
  if (!folder.empty()) CreateFolders(folder);
  CheckReplaced(flags, folder, {file.filename().string()});
  return file.string();
}

void ExportNerfstudio(const Reconstruction& reconstruction, const ExportFlags& flags,
                      ProgressMonitor& monitor) {
  const std::string path = FileIn(flags, ".json", "transforms.json");
  const fs::path folder = fs::absolute(path).parent_path();
  const std::string images =
      flags.image_path.empty()
          ? "images"
          : fs::proximate(fs::absolute(flags.image_path), folder).generic_string();
  std::string points;
  if (!reconstruction.points3D.empty()) {
    points = "points.ply";
    CheckReplaced(flags, folder.string(), {points});
    WritePly(reconstruction, (folder / points).string(), {.cameras = false});
  }
  for (const std::string& warning : WriteTransformsJson(reconstruction, path, images, points)) {
    monitor.Warning(warning);
  }
}

void ExportOneDsfmDataset(const Reconstruction& reconstruction, const ExportFlags& flags,
                          ProgressMonitor& monitor) {
  CheckReplaced(flags, flags.output_path, {"list.txt"});
  const Database database(flags.database_path, Database::Mode::kSnapshot);
  const OneDsfmExportReport report = ExportOneDsfm(reconstruction, database, flags.image_path,
                                                   flags.output_path, flags.Run(monitor));
  monitor.Info("data set of " + std::to_string(report.num_images) + " images, " +
               std::to_string(report.num_registered) + " in cc.txt, " +
               std::to_string(report.num_edges) + " edges, " + std::to_string(report.num_tracks) +
               " tracks; photographs: " + std::to_string(report.num_resampled) + " resampled, " +
               std::to_string(report.num_copied) + " copied, " +
               std::to_string(report.num_without_photo) + " missing");
}

// COLMAP's text files end a name at its first blank.
void WarnOfBlanks(const Reconstruction& reconstruction, ProgressMonitor& monitor) {
  const auto num = std::ranges::count_if(reconstruction.images, [](const auto& entry) {
    return entry.second.image.name.find_first_of(" \t") != std::string::npos;
  });
  if (num == 0) return;
  monitor.Warning(std::to_string(num) +
                  " image names contain blanks, after which COLMAP reads no more of a text file; "
                  "colmap_bin keeps them");
}

int Run(Command& command, ExportFlags& flags) {
  if (flags.output_type == "1dsfm") {
    for (const char* key : {"database_path", "image_path"}) command.Require(key);
  }
  ConsoleMonitor monitor;
  WarnOfUnfinishedModels(flags.model_path, monitor);
  Reconstruction reconstruction = ReadModel(flags.model_path, {.list_path = flags.model_list});
  const bool needs_sizes =
      flags.output_type != "bundler" && flags.output_type != "ply" && flags.output_type != "gltf";
  if (needs_sizes || !flags.image_path.empty()) {
    CompleteImageSizes(flags.image_path, reconstruction);
  }
  if (flags.output_type == "1dsfm") {
    ExportOneDsfmDataset(reconstruction, flags, monitor);
  } else if (flags.output_type == "colmap_bin") {
    WriteColmapResult(reconstruction, flags.output_path, {.command = "export"}, flags.overwrite);
  } else if (flags.output_type == "colmap_txt") {
    WarnOfBlanks(reconstruction, monitor);
    WriteColmapResult(reconstruction, flags.output_path,
                      {.command = "export", .format = ColmapModelFormat::kText}, flags.overwrite);
  } else if (flags.output_type == "bundler") {
    CreateFolders(flags.output_path);
    CheckReplaced(flags, flags.output_path, {"bundle.out", "list.txt"});
    const std::string folder = flags.output_path + "/";
    for (const std::string& warning :
         WriteBundler(reconstruction, folder + "bundle.out", folder + "list.txt")) {
      monitor.Warning(warning);
    }
  } else if (flags.output_type == "ply") {
    WritePly(reconstruction, FileIn(flags, ".ply", "points.ply"));
  } else if (flags.output_type == "gltf") {
    WriteGltf(reconstruction, FileIn(flags, ".glb", "model.glb"));
  } else {
    ExportNerfstudio(reconstruction, flags, monitor);
  }
  monitor.Info(std::to_string(reconstruction.images.size()) + " images and " +
               std::to_string(reconstruction.points3D.size()) + " points written as " +
               flags.output_type + " to " + flags.output_path);
  WarnOfOtherModels(flags.model_path, "exported", monitor);
  return kExitSuccess;
}

}  // namespace

void AddExportCommand(Program& program) {
  AddCommand<ExportFlags>(program, "export", "Writes a model in another format.",
                          {"model_path", "output_path"}, Run);
}

}  // namespace cairn
