#include "cairn/image/bitmap.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>

#include "cairn/base/check.h"
#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "image/image_container.h"

namespace cairn {
namespace {

// OpenCV wants a mutable pointer but only reads.
cv::Mat AsRow(std::string& bytes) {
  return cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1, bytes.data());
}

cv::Mat Decode(const std::string& path, std::string& bytes, int flags) {
  try {
    cv::Mat image = cv::imdecode(AsRow(bytes), flags | cv::IMREAD_IGNORE_ORIENTATION);
    if (!image.empty()) return image;
  } catch (const cv::Exception& error) {
    throw IoError(path, "cannot be decoded: " + error.err);
  }
  throw IoError(path, "cannot be decoded: not an image, or a damaged one");
}

// Swaps the first and the third channel while copying from `src` to `dst`, both of n pixels.
void SwapRedBlue(const uint8_t* src, uint8_t* dst, size_t n) {
  for (size_t i = 0; i < 3 * n; i += 3) {
    dst[i] = src[i + 2];
    dst[i + 1] = src[i + 1];
    dst[i + 2] = src[i];
  }
}

std::string ReadImageFile(const std::string& path) {
  std::string bytes = ReadFile(path);
  if (bytes.empty()) throw IoError(path, "the file is empty");
  if (bytes.size() > static_cast<size_t>(std::numeric_limits<int>::max())) {
    throw IoError(path, "the file has more than 2 GiB");
  }
  return bytes;
}

std::string ExtensionOf(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  for (char& c : extension) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return extension;
}

// A beginning of a file that is long enough for the headers of nearly every photograph.
std::string ReadHead(const std::string& path, size_t num_bytes) {
  std::FILE* file = std::fopen(path.c_str(), "rb");
  if (!file) return ReadFile(path);  // throws with the reason
  std::string head(num_bytes, '\0');
  head.resize(std::fread(head.data(), 1, num_bytes, file));
  std::fclose(file);
  return head;
}

}  // namespace

Bitmap ReadBitmap(const std::string& path, BitmapColor color) {
  std::string bytes = ReadImageFile(path);
  const ContainerInfo info = InspectContainer(bytes);
  if (!info.is_complete) throw IoError(path, "the image is truncated");
  const bool is_gray = color == BitmapColor::kGray;
  const cv::Mat image = Decode(path, bytes, is_gray ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR);
  Bitmap bitmap;
  bitmap.width = image.cols;
  bitmap.height = image.rows;
  bitmap.channels = is_gray ? 1 : 3;
  const size_t row_size = static_cast<size_t>(image.cols) * bitmap.channels;
  bitmap.data.resize(row_size * image.rows);
  for (int y = 0; y < image.rows; ++y) {
    uint8_t* row = bitmap.data.data() + row_size * y;
    if (is_gray) {
      std::copy_n(image.ptr<uint8_t>(y), row_size, row);
    } else {
      SwapRedBlue(image.ptr<uint8_t>(y), row, image.cols);
    }
  }
  return bitmap;
}

void WriteBitmap(const std::string& path, const Bitmap& bitmap, int jpeg_quality) {
  CAIRN_CHECK(bitmap.channels == 1 || bitmap.channels == 3);
  CAIRN_CHECK(bitmap.width > 0 && bitmap.height > 0);
  CAIRN_CHECK_EQ(bitmap.data.size(),
                 static_cast<size_t>(bitmap.width) * bitmap.height * bitmap.channels);
  cv::Mat image(bitmap.height, bitmap.width, bitmap.channels == 1 ? CV_8UC1 : CV_8UC3);
  if (bitmap.channels == 1) {
    std::copy(bitmap.data.begin(), bitmap.data.end(), image.ptr<uint8_t>());
  } else {
    SwapRedBlue(bitmap.data.data(), image.ptr<uint8_t>(),
                static_cast<size_t>(bitmap.width) * bitmap.height);
  }
  std::vector<uint8_t> bytes;
  try {
    if (!cv::imencode(ExtensionOf(path), image, bytes, {cv::IMWRITE_JPEG_QUALITY, jpeg_quality})) {
      throw IoError(path, "cannot be encoded");
    }
  } catch (const cv::Exception&) {
    throw IoError(path, "no image format has the extension '" + ExtensionOf(path) + "'");
  }
  WriteFileAtomically(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

ImageSize ReadImageSize(const std::string& path) {
  constexpr size_t kHeadSize = 1 << 16;
  std::string bytes = ReadHead(path, kHeadSize);
  std::optional<ImageSize> size = InspectContainer(bytes).size;
  if (!size) {
    bytes = ReadImageFile(path);
    const ContainerInfo info = InspectContainer(bytes);
    if (!info.size && !info.is_complete) throw IoError(path, "the image is truncated");
    size = info.size;
  }
  if (!size) {
    const cv::Mat image = Decode(path, bytes, cv::IMREAD_UNCHANGED);
    size = ImageSize{image.cols, image.rows};
  }
  if (size->width <= 0 || size->height <= 0) throw IoError(path, "the image has no pixels");
  return *size;
}

}  // namespace cairn
