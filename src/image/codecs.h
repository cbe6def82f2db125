#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/image/bitmap.h"

namespace cairn {

// Whole files in memory, by OpenCV's codecs. They throw IoError(path, reason).
// reduction: 1, or 2, 4 or 8, by which both sides are divided (at once, in a JPEG).
Bitmap DecodeImage(const std::string& path, std::string_view bytes, BitmapColor color,
                   int reduction = 1);
// As ReadMask.
Bitmap DecodeMask(const std::string& path, std::string_view bytes);
// May a PNG or WebP file that begins so have a channel of opacity, or a palette with opacities?
// (ISO 15948, 11.2.2, the color type; RFC 9649, 2.7.)
bool MayHaveOpacity(std::string_view bytes);
// As ReadOpacity.
std::optional<Bitmap> DecodeOpacity(const std::string& path, std::string_view bytes);
// extension: ".png", ... in lower case. opacity: of an RGB bitmap, for formats that have it.
std::vector<uint8_t> EncodeImage(const std::string& path, const std::string& extension,
                                 const Bitmap& bitmap, int jpeg_quality,
                                 const Bitmap* opacity = nullptr);

}  // namespace cairn
