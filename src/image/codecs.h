#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/image/bitmap.h"

namespace cairn {

// Whole files in memory, by OpenCV's codecs. They throw IoError(path, reason).
Bitmap DecodeImage(const std::string& path, std::string_view bytes, BitmapColor color);
// extension: ".png", ... in lower case.
std::vector<uint8_t> EncodeImage(const std::string& path, const std::string& extension,
                                 const Bitmap& bitmap, int jpeg_quality);

}  // namespace cairn
