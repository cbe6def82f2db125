#include "cairn/image/bitmap.h"

#include <algorithm>

#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "image/codecs.h"
#include "image/image_container.h"

namespace cairn {
namespace {

std::string ReadImageFile(const std::string& path) {
  std::string bytes = ReadFile(path);
  if (bytes.empty()) throw IoError(path, "the file is empty");
  return bytes;
}

}  // namespace

std::string SizeText(const ImageSize& size) {
  return std::to_string(size.width) + " x " + std::to_string(size.height);
}

Bitmap ReadBitmap(const std::string& path, BitmapColor color) {
  return DecodeImage(path, ReadImageFile(path), color);
}

Bitmap ReadMask(const std::string& path) { return DecodeMask(path, ReadImageFile(path)); }

std::optional<Bitmap> ReadOpacity(const std::string& path) {
  constexpr size_t kHeadSize = 32;
  if (!MayHaveOpacity(ReadFile(path, kHeadSize))) return std::nullopt;
  return DecodeOpacity(path, ReadImageFile(path));
}

Bitmap ReadReducedBitmap(const std::string& path, BitmapColor color, int min_longer_side) {
  const std::string bytes = ReadImageFile(path);
  const ImageSize size = InspectContainer(bytes).size.value_or(ImageSize{});
  int reduction = 1;
  while (reduction < 8 && std::max(size.width, size.height) / (2 * reduction) >= min_longer_side) {
    reduction *= 2;
  }
  return DecodeImage(path, bytes, color, reduction);
}

void WriteBitmap(const std::string& path, const Bitmap& bitmap, int jpeg_quality) {
  CAIRN_CHECK(bitmap.channels == 1 || bitmap.channels == 3);
  CAIRN_CHECK(bitmap.width > 0 && bitmap.height > 0);
  CAIRN_CHECK_EQ(bitmap.data.size(),
                 static_cast<size_t>(bitmap.width) * bitmap.height * bitmap.channels);
  const std::vector<uint8_t> bytes =
      EncodeImage(path, LowerCaseExtension(path), bitmap, jpeg_quality);
  WriteFileAtomically(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

ImageSize ReadImageSize(const std::string& path) {
  constexpr size_t kHeadSize = 1 << 16;  // enough for nearly every photograph
  std::string bytes = ReadFile(path, kHeadSize);
  std::optional<ImageSize> size = InspectContainer(bytes).size;
  if (!size) {
    bytes = ReadImageFile(path);
    const ContainerInfo info = InspectContainer(bytes);
    if (!info.size && !info.is_complete) throw IoError(path, "the image is truncated");
    size = info.size;
  }
  if (!size) {
    const Bitmap bitmap = DecodeImage(path, bytes, BitmapColor::kGray);
    size = ImageSize{bitmap.width, bitmap.height};
  }
  if (size->width <= 0 || size->height <= 0) throw IoError(path, "the image has no pixels");
  constexpr int64_t kMaxPixels = 1 << 30;  // what OpenCV decodes
  if (static_cast<int64_t>(size->width) * size->height > kMaxPixels) {
    throw IoError(path, "the image has " + SizeText(*size) + " pixels; up to 2^30 are read");
  }
  return *size;
}

}  // namespace cairn
