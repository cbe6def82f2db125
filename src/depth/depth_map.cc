#include "cairn/depth/depth_map.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <filesystem>
#include <numeric>

#include "cairn/base/check.h"
#include "cairn/base/file.h"

namespace cairn {

int DepthMap::NumValid() const { return std::accumulate(is_valid.begin(), is_valid.end(), 0); }

std::string FaultOfMapSize(const ImageSize& map, const ImageSize& image) {
  constexpr double kMaxStretch = 1.1;  // of networks whose sides are multiples of 32
  if (std::min(map.width, map.height) < 2) {
    return "a map of " + SizeText(map) + " values has no gradient";
  }
  const double image_shape = static_cast<double>(image.width) / image.height;
  const double map_shape = static_cast<double>(map.width) / map.height;
  const auto is_like = [&](double shape) {
    return std::abs(std::log(shape / image_shape)) < std::log(kMaxStretch);
  };
  if (is_like(map_shape) || !is_like(1 / map_shape)) return "";
  return "a map of " + SizeText(map) + " values for an image of " + SizeText(image) +
         " pixels: it is transposed";
}

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

// NumPy's format, version 1.0: little-endian, C order.
void WriteDepthMap(const std::string& path, const DepthMap& map) {
  static_assert(std::endian::native == std::endian::little);
  std::string header = "{'descr': '<f4', 'fortran_order': False, 'shape': (" +
                       std::to_string(map.height) + ", " + std::to_string(map.width) + "), }";
  constexpr size_t kPreamble = 10;  // magic, version, length of the header
  header.append(63 - (kPreamble + header.size()) % 64, ' ');
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += static_cast<char>(header.size() & 0xff);
  bytes += static_cast<char>(header.size() >> 8);
  bytes += header;
  bytes.append(reinterpret_cast<const char*>(map.values.data()), map.values.size() * sizeof(float));
  WriteFileAtomically(path, bytes);
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
