#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "cairn/image/bitmap.h"

namespace cairn {

// Decoders and encoders of whole files in memory. They throw IoError(path, reason).

// JPEG by libjpeg, PNG by libpng. False, without touching the bitmap, for what these do not do
// (JPEG files in CMYK, PNG files that are damaged).
bool DecodeJpeg(const std::string& path, std::string_view bytes, BitmapColor color, Bitmap* bitmap);
bool DecodePng(std::string_view bytes, BitmapColor color, Bitmap* bitmap);

// All other formats by OpenCV, whose codecs (with GDAL behind them) are 140 shared libraries, 0.08
// s and 45 MB: they are in a plugin that is loaded when the first such file comes.
Bitmap DecodeByOpenCv(const std::string& path, const std::string& bytes, BitmapColor color);
// extension: ".png", ... in lower case.
std::vector<uint8_t> EncodeByOpenCv(const std::string& path, const std::string& extension,
                                    const Bitmap& bitmap, int jpeg_quality);

// The plugin's functions; false: the reason is in *error.
extern "C" {
using DecodeFunction = bool (*)(const std::string& bytes, bool is_gray, Bitmap* bitmap,
                                std::string* error);
using EncodeFunction = bool (*)(const std::string& extension, const Bitmap& bitmap,
                                int jpeg_quality, std::vector<uint8_t>* bytes, std::string* error);
}

}  // namespace cairn
