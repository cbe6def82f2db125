#include <cstdio>
#include <filesystem>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/bundle_adjustment/pose_confidence.h"
#include "cairn/io/bundler.h"
#include "cairn/io/colmap_model.h"
#include "cairn/io/ply.h"
#include "cairn/mapper/reconstruct.h"
#include "cairn/view_graph/view_graph_text.h"

namespace cairn {
namespace {

namespace fs = std::filesystem;

// Models with a larger number than this run has, from an earlier run.
void RemoveOlderModels(const fs::path& sparse, size_t first) {
  for (size_t k = first; fs::exists(sparse / std::to_string(k) / "cameras.bin"); ++k) {
    const fs::path folder = sparse / std::to_string(k);
    std::error_code error;
    for (const char* name : {"cameras.bin", "images.bin", "points3D.bin"}) {
      fs::remove(folder / name, error);
      if (error) throw IoError((folder / name).string(), error.message());
    }
    fs::remove(folder, error);  // stays if the user keeps something there
  }
}

// One line an image: what holds its pose.
std::string ConfidenceCsv(const ReconstructResult& result) {
  std::string text = "image,model,pairs,points,rotation_sigma_deg,position_sigma\n";
  for (size_t k = 0; k < result.models.size(); ++k) {
    const Reconstruction& model = result.models[k];
    std::map<image_t, int> num_pairs;
    for (const ViewEdge& edge : result.graph.edges) {
      const bool is_inside =
          model.images.count(edge.image_id1) && model.images.count(edge.image_id2);
      if (!edge.IsActive() || !is_inside) continue;
      ++num_pairs[edge.image_id1];
      ++num_pairs[edge.image_id2];
    }
    for (const auto& [id, confidence] : EstimatePoseConfidence(model)) {
      char line[128];
      std::snprintf(line, sizeof(line), ",%zu,%d,%d,%.6g,%.6g\n", k, num_pairs[id],
                    confidence.num_points, confidence.rotation_sigma_deg,
                    confidence.position_sigma);
      text += model.images.at(id).image.name + line;
    }
  }
  return text;
}

}  // namespace

void CheckReconstructOutput(const std::string& output_path) {
  const fs::path output(output_path);
  const fs::path options = output / "effective.toml";
  if (fs::exists(options) &&
      ReadFile(options.string()).starts_with("# global_sfm reconstruct, cairn ")) {
    return;
  }
  for (const char* name : {"sparse", "bundle.out", "list.txt", "points.ply"}) {
    if (!fs::exists(output / name) || fs::is_empty(output / name)) continue;
    throw ConfigError(
        "output_path",
        (output / name).string() +
            " was not written by cairn and would be replaced; give another folder, or "
            "--overwrite");
  }
}

void WriteReconstructResult(ReconstructResult& result, const std::string& output_path,
                            const std::string& effective_toml) {
  const fs::path output(output_path);
  CreateFolders(output_path);
  WriteFileAtomically((output / "effective.toml").string(), effective_toml);
  if (!result.models.empty()) {
    for (size_t k = 0; k < result.models.size(); ++k) {
      WriteColmapModel(result.models[k], (output / "sparse" / std::to_string(k)).string());
    }
    RemoveOlderModels(output / "sparse", result.models.size());
    const Reconstruction& largest = result.models.front();
    const std::vector<std::string> warnings = WriteBundler(
        largest, (output / "bundle.out").string(), (output / "list.txt").string(), result.images);
    if (!warnings.empty()) {
      StageReport stage;
      stage.name = "bundler";
      stage.messages = warnings;
      result.report.stages.push_back(std::move(stage));
    }
    WriteFileAtomically((output / "confidence.csv").string(), ConfidenceCsv(result));
    WritePly(largest, (output / "points.ply").string());
  }
  if (result.page.empty()) {
    fs::remove(output / "report.html");  // of an earlier run
  } else {
    WriteFileAtomically((output / "report.html").string(), result.page);
  }
  std::map<image_t, std::string> names;
  for (const Image& image : result.images) names[image.image_id] = image.name;
  WriteFileAtomically((output / "view_graph.json").string(), ViewGraphToJson(result.graph, names));
  WriteFileAtomically((output / "view_graph.dot").string(), ViewGraphToDot(result.graph, names));
  WriteFileAtomically((output / "report.json").string(), ToJson(result.report));
}

}  // namespace cairn
