#include "cairn/io/model.h"

#include <filesystem>

#include "cairn/base/error.h"
#include "cairn/io/bundler.h"
#include "cairn/io/colmap_model.h"
#include "cairn/io/strecha.h"

namespace cairn {

Reconstruction ReadModel(const std::string& path, const ReadModelOptions& options) {
  std::error_code ignored;
  if (!std::filesystem::exists(path, ignored)) throw IoError(path, "no such file or folder");
  if (path.ends_with(".out") && !std::filesystem::is_directory(path, ignored)) {
    const std::string beside = (std::filesystem::path(path).parent_path() / "list.txt").string();
    return ReadBundler(path, options.list_path.empty() ? beside : options.list_path,
                       {.read_points = options.read_points});
  }
  const std::string folder = ModelsIn(path).front();
  if (IsColmapModel(folder)) return ReadColmapModel(folder);
  if (IsStrechaFolder(path)) return ReadStrecha(path);
  throw IoError(path,
                "is neither a COLMAP model (cameras.bin or cameras.txt), nor a folder of .camera "
                "files, nor a Bundler file (.out)");
}

std::vector<std::string> ModelsIn(const std::string& path) {
  const std::filesystem::path itself(path);
  std::vector<std::string> models;
  for (const std::filesystem::path& folder : {itself, itself / "sparse"}) {
    if (IsColmapModel(folder)) return {folder};
    for (int k = 0; IsColmapModel(folder / std::to_string(k)); ++k) {
      models.push_back(folder / std::to_string(k));
    }
    if (!models.empty()) return models;
  }
  return {path};
}

std::vector<Reconstruction> ReadModels(const std::string& path) {
  std::vector<Reconstruction> models;
  for (const std::string& model : ModelsIn(path)) models.push_back(ReadModel(model));
  return models;
}

}  // namespace cairn
