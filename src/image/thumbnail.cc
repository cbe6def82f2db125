#include "cairn/image/thumbnail.h"

#include <algorithm>

#include "cairn/image/resample.h"
#include "image/codecs.h"

namespace cairn {

std::string MakeThumbnail(const std::string& path, int max_side_px, int jpeg_quality) {
  Bitmap image = ReadReducedBitmap(path, BitmapColor::kRgb, max_side_px);
  const double scale = static_cast<double>(max_side_px) / std::max(image.width, image.height);
  const auto scaled = [&](int side) { return std::max(1, static_cast<int>(side * scale + 0.5)); };
  if (scale < 1) image = ReducedBitmap(image, scaled(image.width), scaled(image.height));
  const std::vector<uint8_t> jpeg = EncodeImage(path, ".jpg", image, jpeg_quality);
  return {jpeg.begin(), jpeg.end()};
}

}  // namespace cairn
