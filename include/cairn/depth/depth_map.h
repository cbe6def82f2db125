#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "cairn/depth/options.h"
#include "cairn/image/bitmap.h"

namespace cairn {

// z-depth over an image, row-major, in its own unknown unit, or inverse depth, which may lack an
// unknown shift. The map is stretched over its image: the map's corners are the image's corners,
// whatever the two sizes.
struct DepthMap {
  int width = 0;
  int height = 0;
  bool is_inverse = false;
  std::vector<float> values;      // where valid: z-depth > 0, or inverse depth of any sign; else 0
  std::vector<uint8_t> is_valid;  // 0 or 1

  int NumValid() const;
};

// Why a map of this size cannot be of an image of that size; "": it can. Maps may be smaller, or
// stretched, but turned by a right angle they are of another image, or in the wrong order.
std::string FaultOfMapSize(const ImageSize& map, const ImageSize& image);

// Takes raw values (row-major, width * height) as options.kind and options.scale say. Values that
// are not finite, depths that are not positive, and inverse depths of exactly 0 become missing.
DepthMap DepthMapFromValues(int width, int height, const std::vector<float>& values,
                            const DepthOptions& options);

// Reads .npy (float16/32/64 or uint16, H x W or 1 x H x W, C order), .pfm (one channel), 8- or
// 16-bit .png, and COLMAP's dense .bin, by extension. Throws IoError with path and reason: absent,
// truncated, wrong shape or type, no valid value at all.
DepthMap ReadDepthMap(const std::string& path, const DepthOptions& options);

// Writes the values as .npy: float32, 0 where none is valid. Throws IoError.
void WriteDepthMap(const std::string& path, const DepthMap& map);

// The depth map of an image in a folder: <image name> with .npy, .pfm, .png, .bin,
// .geometric.bin or .photometric.bin appended, the first that exists.
std::optional<std::string> FindDepthMap(const std::string& folder, const std::string& image_name);

}  // namespace cairn
