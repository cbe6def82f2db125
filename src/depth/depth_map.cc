#include "cairn/depth/depth_map.h"

#include <cmath>
#include <filesystem>
#include <numeric>

#include "cairn/base/check.h"
#include "cairn/base/path_in_folder.h"

namespace cairn {

int DepthMap::NumValid() const { return std::accumulate(is_valid.begin(), is_valid.end(), 0); }

DepthMap DepthMapFromValues(int width, int height, const std::vector<float>& values,
                            const DepthOptions& options) {
  ValidateOptions(options, "depth");
  CAIRN_CHECK_EQ(values.size(), static_cast<size_t>(width) * height);
  DepthMap map;
  map.width = width;
  map.height = height;
  map.is_inverse = options.kind == DepthKind::kInverse;
  map.values.resize(values.size());
  map.is_valid.resize(values.size());
  for (size_t i = 0; i < values.size(); ++i) {
    const double scaled = values[i] * options.scale;
    const auto value =
        static_cast<float>(options.kind == DepthKind::kLog ? std::exp(scaled) : scaled);
    if (!std::isnormal(value) || (value < 0 && !map.is_inverse)) continue;
    map.values[i] = value;
    map.is_valid[i] = 1;
  }
  return map;
}

std::optional<std::string> FindDepthMap(const std::string& folder, const std::string& image_name) {
  for (const char* extension :
       {".npy", ".pfm", ".png", ".bin", ".geometric.bin", ".photometric.bin"}) {
    const std::string path = PathInFolder(folder, image_name + extension);
    std::error_code error;
    if (std::filesystem::exists(path, error)) return path;
  }
  return std::nullopt;
}

}  // namespace cairn
