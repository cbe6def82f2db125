#include <algorithm>
#include <filesystem>
#include <functional>

#include "base/output_folder.h"
#include "base/text.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/base/parallel.h"
#include "cairn/io/bundler.h"
#include "cairn/io/colmap_model.h"
#include "cairn/io/csv.h"
#include "cairn/io/ply.h"
#include "cairn/mapper/reconstruct.h"
#include "cairn/view_graph/view_graph_text.h"
#include "mapper/stages.h"
#include "report/stage.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr char kWriter[] = "reconstruct";  // and refine
// Everything that a run may write.
const std::vector<std::string> kResultNames = {
    "sparse",         "bundle.out",      "list.txt",       "points.ply",
    "confidence.csv", "view_graph.json", "view_graph.dot", "report.json",
    "effective.toml", "report.html",     "failed"};

// One line an image: what holds its pose.
std::string ConfidenceCsv(const ReconstructResult& result) {
  std::string text = "image,model,pairs,points,rotation_sigma_deg,position_sigma\n";
  for (size_t k = 0; k < std::min(result.models.size(), result.confidences.size()); ++k) {
    const Reconstruction& model = result.models[k];
    std::map<image_t, int> num_pairs = NumPairsInUse(result.graph, model);
    for (const auto& [id, confidence] : result.confidences[k]) {
      text += CsvField(model.images.at(id).image.name) +
              Formatted(",%zu,%d,%d,%.6g,%.6g\n", k, num_pairs[id], confidence.num_points,
                        confidence.rotation_sigma_deg, confidence.position_sigma);
    }
  }
  return text;
}

void WriteColmapModels(const ReconstructResult& result, const fs::path& output) {
  for (size_t k = 0; k < result.models.size(); ++k) {
    const fs::path folder = output / "sparse" / std::to_string(k);
    WriteColmapModel(result.models[k], folder.string());
    if (k >= result.georegistrations.size() || result.georegistrations[k].empty()) continue;
    WriteFileAtomically((folder / "georegistration.json").string(), result.georegistrations[k]);
  }
}

// The page is as large as all else, and worth less: what is not written for it is no page.
void WritePage(const std::string& path, ReconstructResult& result, const RunContext& run) {
  if (result.page.empty()) return;
  try {
    WriteFileAtomically(path, result.page);
  } catch (const IoError& error) {
    result.page.clear();
    run.monitor.Warning("report.html " + error.reason() + "; there is none for this run");
  }
}

// Side by side: the text of some takes long to make.
void WriteFiles(ReconstructResult& result, const fs::path& output,
                const std::string& effective_toml, const RunContext& run) {
  std::map<image_t, std::string> names;
  for (const Image& image : result.images) names[image.image_id] = image.name;
  const auto path = [&](const char* name) { return (output / name).string(); };
  std::vector<std::string> warnings;
  std::vector<std::function<void()>> tasks = {
      [&] { WriteFileAtomically(path("effective.toml"), effective_toml); },
      [&] { WriteFileAtomically(path("view_graph.json"), ViewGraphToJson(result.graph, names)); },
      [&] { WriteFileAtomically(path("view_graph.dot"), ViewGraphToDot(result.graph, names)); }};
  if (!result.models.empty()) {
    const Reconstruction& largest = result.models.front();
    tasks.push_back([&] {
      warnings = WriteBundler(largest, path("bundle.out"), path("list.txt"), result.images);
    });
    tasks.push_back([&] { WriteColmapModels(result, output); });
    tasks.push_back([&] { WriteFileAtomically(path("confidence.csv"), ConfidenceCsv(result)); });
    tasks.push_back([&] { WritePly(largest, path("points.ply")); });
  }
  ParallelFor(run.num_threads, std::ssize(tasks), [&](int64_t i) { tasks[i](); });
  if (!warnings.empty()) {
    Stage stage(run.monitor, "bundler");
    stage.NoteEach(warnings);
    result.report.stages.push_back(stage.Finish());
  }
  WriteFileAtomically(path("report.json"), ToJson(result.report));
  WritePage(path("report.html"), result, run);
}

}  // namespace

void CheckReconstructOutput(const std::string& output_path, bool overwrites) {
  const OutputFolder output(output_path, kWriter, kResultNames, overwrites);
}

std::string WriteReconstructResult(ReconstructResult& result, const std::string& output_path,
                                   const std::string& effective_toml, bool overwrites,
                                   const RunContext& run) {
  OutputFolder output(output_path, kWriter, kResultNames, overwrites);
  const bool keeps_earlier =
      !result.report.Succeeded() && fs::exists(fs::path(output_path) / "sparse");
  const std::string folder = keeps_earlier ? "failed" : "";
  const fs::path staging = fs::path(output.staging()) / folder;
  CreateFolders(staging.string());
  WriteFiles(result, staging, effective_toml, run);
  output.Commit(folder);
  return (fs::path(output_path) / folder / "report.json").string();
}

}  // namespace cairn
