#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/depth/options.h"

namespace cairn {

// z-depth over an image, row-major, in its own unknown unit. The map is stretched over its image:
// the map's corners are the image's corners, whatever the two sizes.
struct DepthMap {
  int width = 0;
  int height = 0;
  std::vector<float> depth;       // > 0 and finite where valid, else 0
  std::vector<uint8_t> is_valid;  // 0 or 1

  int NumValid() const;
};

// Turns raw values (row-major, width * height) into depth as options.kind and options.scale say.
// Values that are not finite, and those whose depth is not positive and finite, become missing.
DepthMap DepthMapFromValues(int width, int height, const std::vector<float>& values,
                            const DepthOptions& options);

// Reads .npy (float16/32/64 or uint16, H x W or 1 x H x W, C order), .pfm (one channel), 8- or
// 16-bit .png, and COLMAP's dense .bin, by extension. Throws IoError with path and reason: absent,
// truncated, wrong shape or type, no valid value at all.
DepthMap ReadDepthMap(const std::string& path, const DepthOptions& options);

// The depth map of an image in a folder: <image name> with .npy, .pfm, .png, .bin,
// .geometric.bin or .photometric.bin appended, the first that exists.
std::optional<std::string> FindDepthMap(const std::string& folder, const std::string& image_name);

}  // namespace cairn
