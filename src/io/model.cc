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
  if (path.ends_with(".out")) {
    const std::string beside = (std::filesystem::path(path).parent_path() / "list.txt").string();
    return ReadBundler(path, options.list_path.empty() ? beside : options.list_path,
                       {.read_points = options.read_points});
  }
  if (IsColmapModel(path)) return ReadColmapModel(path);
  if (IsStrechaFolder(path)) return ReadStrecha(path);
  const std::string below = path + "/sparse/0";
  if (IsColmapModel(below))
    throw IoError(path, "holds no model itself; did you mean " + below + "?");
  throw IoError(path,
                "is neither a COLMAP model (cameras.bin or cameras.txt), nor a folder of .camera "
                "files, nor a Bundler file (.out)");
}

}  // namespace cairn
