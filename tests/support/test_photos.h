#pragma once

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "cairn/base/rng.h"
#include "cairn/depth/depth_map.h"
#include "cairn/image/bitmap.h"

namespace cairn {

// A photograph of a flat wall of random blobs, `shift` pixels to the right of the first: photos
// with near shifts overlap and have features that match.
inline Bitmap WallPhoto(int width, int height, int shift, uint64_t wall = 1) {
  Bitmap bitmap;
  bitmap.width = width;
  bitmap.height = height;
  bitmap.data.assign(static_cast<size_t>(width) * height, 110);
  Rng rng(wall);
  for (int blob = 0; blob < 400; ++blob) {
    const double cx = rng.Uniform(0, 400) - shift;
    const double cy = rng.Uniform(0, height);
    const double radius = rng.Uniform(1.5, 5);
    const double gray = rng.Uniform(-100, 100);
    const int reach = static_cast<int>(3 * radius) + 1;
    for (int y = std::max(0, static_cast<int>(cy) - reach);
         y < std::min(height, static_cast<int>(cy) + reach); ++y) {
      for (int x = std::max(0, static_cast<int>(cx) - reach);
           x < std::min(width, static_cast<int>(cx) + reach); ++x) {
        const double d2 = ((x - cx) * (x - cx) + (y - cy) * (y - cy)) / (radius * radius);
        const double value = *bitmap.Pixel(x, y) + gray * std::exp(-d2 / 2);
        *bitmap.Pixel(x, y) = static_cast<uint8_t>(std::clamp(value, 0.0, 255.0));
      }
    }
  }
  return bitmap;
}

// A float32 .npy file.
inline void WriteNpy(const std::string& path, int width, int height,
                     const std::vector<float>& values) {
  WriteDepthMap(path, {width, height, false, values, {}});
}

}  // namespace cairn
