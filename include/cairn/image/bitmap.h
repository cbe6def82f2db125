#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace cairn {

// 8-bit image, row-major, channels interleaved: 1 (gray) or 3 (RGB).
struct Bitmap {
  int width = 0;
  int height = 0;
  int channels = 1;
  std::vector<uint8_t> data;

  const uint8_t* Pixel(int x, int y) const {
    return &data[(static_cast<size_t>(y) * width + x) * channels];
  }
  uint8_t* Pixel(int x, int y) { return &data[(static_cast<size_t>(y) * width + x) * channels]; }
};

enum class BitmapColor { kGray, kRgb };

// Decodes a photograph without rotating it by its EXIF orientation, as COLMAP does. Throws IoError
// with the path and the reason (absent, empty, truncated, not an image).
Bitmap ReadBitmap(const std::string& path, BitmapColor color);
// A mask, gray: 0 where the file has 0, which is black, and nowhere else. Throws IoError.
Bitmap ReadMask(const std::string& path);
// The opacity of a PNG or WebP file that has one (0: nothing is to be seen); nullopt: it has none.
std::optional<Bitmap> ReadOpacity(const std::string& path);
// A photograph at a half, a quarter or an eighth of its size, while its longer side keeps so many
// pixels. A JPEG takes less time then.
Bitmap ReadReducedBitmap(const std::string& path, BitmapColor color, int min_longer_side);
// Format by extension: .png, .jpg, .jpeg, .ppm (RGB) or .pgm (gray), .bmp, .tif. Appears complete
// or not at all. Throws IoError.
void WriteBitmap(const std::string& path, const Bitmap& bitmap, int jpeg_quality = 95);

struct ImageSize {
  int width = 0;
  int height = 0;
  bool operator==(const ImageSize&) const = default;
};
// "1200 x 900".
std::string SizeText(const ImageSize& size);
// The size in pixels from the file's header (JPEG and PNG, some 10 microseconds; other formats are
// decoded). Throws IoError as ReadBitmap does, except that a truncated body goes undetected.
ImageSize ReadImageSize(const std::string& path);

}  // namespace cairn
