#include <algorithm>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>

#include "image/codecs.h"

namespace cairn {
namespace {

// Swaps the first and the third channel while copying from `src` to `dst`, both of n pixels.
void SwapRedBlue(const uint8_t* src, uint8_t* dst, size_t n) {
  for (size_t i = 0; i < 3 * n; i += 3) {
    dst[i] = src[i + 2];
    dst[i + 1] = src[i + 1];
    dst[i + 2] = src[i];
  }
}

void CopyImage(const cv::Mat& image, bool is_gray, Bitmap* bitmap) {
  bitmap->width = image.cols;
  bitmap->height = image.rows;
  bitmap->channels = is_gray ? 1 : 3;
  const size_t row_size = static_cast<size_t>(image.cols) * bitmap->channels;
  bitmap->data.resize(row_size * image.rows);
  for (int y = 0; y < image.rows; ++y) {
    uint8_t* row = bitmap->data.data() + row_size * y;
    if (is_gray) {
      std::copy_n(image.ptr<uint8_t>(y), row_size, row);
    } else {
      SwapRedBlue(image.ptr<uint8_t>(y), row, image.cols);
    }
  }
}

}  // namespace

extern "C" bool CairnDecodeImage(const std::string& bytes, bool is_gray, Bitmap* bitmap,
                                 std::string* error) {
  // OpenCV wants a mutable pointer but only reads.
  const cv::Mat row(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
  const int flags = is_gray ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR;
  try {
    const cv::Mat image = cv::imdecode(row, flags | cv::IMREAD_IGNORE_ORIENTATION);
    if (!image.empty()) {
      CopyImage(image, is_gray, bitmap);
      return true;
    }
    *error = "cannot be decoded: not an image, or a damaged one";
  } catch (const cv::Exception& exception) {
    *error = "cannot be decoded: " + exception.err;
  }
  return false;
}

extern "C" bool CairnEncodeImage(const std::string& extension, const Bitmap& bitmap,
                                 int jpeg_quality, std::vector<uint8_t>* bytes,
                                 std::string* error) {
  cv::Mat image(bitmap.height, bitmap.width, bitmap.channels == 1 ? CV_8UC1 : CV_8UC3);
  if (bitmap.channels == 1) {
    std::copy(bitmap.data.begin(), bitmap.data.end(), image.ptr<uint8_t>());
  } else {
    SwapRedBlue(bitmap.data.data(), image.ptr<uint8_t>(),
                static_cast<size_t>(bitmap.width) * bitmap.height);
  }
  try {
    if (cv::imencode(extension, image, *bytes, {cv::IMWRITE_JPEG_QUALITY, jpeg_quality})) {
      return true;
    }
    *error = "cannot be encoded";
  } catch (const cv::Exception&) {
    *error = "no image format has the extension '" + extension + "'";
  }
  return false;
}

}  // namespace cairn
