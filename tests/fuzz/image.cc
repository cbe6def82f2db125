// A photograph's header, EXIF block and, where it is small, pixels.
#include "cairn/image/bitmap.h"
#include "cairn/image/exif.h"
#include "fuzz/input.h"
#include "fuzz/targets.h"

namespace cairn::fuzz {

void FuzzImage(std::string_view input) {
  constexpr int64_t kMaxPixels = 1 << 18;
  static const Scratch scratch;
  const std::string path = scratch.Write("photo.jpg", input);
  ReadOrRefuse([&] { ReadExif(path, 4000, 3000); });
  ReadOrRefuse([&] {
    const ImageSize size = ReadImageSize(path);
    if (int64_t{size.width} * size.height <= kMaxPixels) ReadBitmap(path, BitmapColor::kRgb);
  });
}

}  // namespace cairn::fuzz
