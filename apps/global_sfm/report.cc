#include <spdlog/spdlog.h>

#include <filesystem>

#include "base/output_folder.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/io/model.h"
#include "cairn/mapper/view_edges.h"
#include "cairn/view_graph/view_graph_builder.h"
#include "common/console_monitor.h"
#include "common/run_flags.h"
#include "common/run_page.h"
#include "global_sfm/commands.h"
#include "global_sfm/image_ids.h"
#include "global_sfm/run_folder.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

struct ReportFlags : ThreadFlags {
  std::string database_path;
  std::string model_path;
  std::string image_path;
  std::string output_path;
  std::string three_path = kThreeFolder;

  void VisitFields(OptionVisitor& v) {
    v.String("database_path", database_path,
             "database of the model; not given: the one it was reconstructed from");
    v.String("model_path", model_path,
             "folder that reconstruct wrote, also of a failed run; or a model of any format");
    v.String("image_path", image_path,
             "folder of the photographs, for thumbnails; not given: the one of the reconstruction");
    v.String("output_path", output_path, "the HTML file");
    v.String("three_path", three_path, "folder of three.js, which the 3D view needs");
    ThreadFlags::VisitFields(v);
  }
};

// The view graph of a model that no run of reconstruct lies around.
ViewGraph GraphOf(const Database& database) {
  std::vector<image_t> image_ids;
  for (const Image& image : database.ReadImages()) image_ids.push_back(image.image_id);
  return BuildViewGraph(image_ids, ReadViewEdges(database)).graph;
}

// Takes the flags that are not given from a run of reconstruct in the folder, if there is one.
void CompleteFlags(const std::string& folder, Command& command, const ReportFlags& flags) {
  const bool is_given = !flags.database_path.empty();
  const std::string options = folder + "/effective.toml";
  try {
    if (!folder.empty()) command.SetDefaults(ReadFile(options), options);
  } catch (const IoError&) {
    if (!is_given) throw;
  }
  if (flags.database_path.empty()) {
    throw ConfigError("--database_path",
                      "is required for a model that reconstruct did not write: "
                      "its pairs are in the database");
  }
  if (!is_given && !fs::exists(flags.database_path)) {
    throw IoError(flags.database_path, "no such file, as reconstruct was called with (" + options +
                                           "): give --database_path");
  }
}

int Run(Command& command, ReportFlags& flags) {
  const std::string folder = RunFolderOf(flags.model_path);
  CompleteFlags(folder, command, flags);
  ConsoleMonitor monitor;
  const Database database(flags.database_path, Database::Mode::kSnapshot);
  RunFolder run;
  if (folder.empty()) {
    run.models.push_back(WithImageIdsOf(database.ReadImages(), ReadModel(flags.model_path)));
    run.model_names.push_back(fs::path(flags.model_path).lexically_normal().string());
    run.graph = GraphOf(database);
  } else {
    run = ReadRunFolder(folder);
  }
  const std::string html = MakePage(database,
                                    {.image_path = flags.image_path,
                                     .models = run.models,
                                     .model_names = run.model_names,
                                     .confidences = run.confidences,
                                     .graph = run.graph,
                                     .run_json = run.report_json,
                                     .three_folder = flags.three_path},
                                    flags.Run(monitor));
  WriteFileAtomically(flags.output_path, html);
  RecordRewritten(flags.output_path);
  spdlog::info("{}: {:.1f} MB; open it in a browser", flags.output_path,
               1e-6 * static_cast<double>(html.size()));
  return kExitSuccess;
}

}  // namespace

void AddReportCommand(Program& program) {
  AddCommand<ReportFlags>(
      program, "report",
      "A page for the browser that shows a reconstruction, or why there is none.",
      {"model_path", "output_path"}, Run);
}

}  // namespace cairn
