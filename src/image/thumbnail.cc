#include "cairn/image/thumbnail.h"

#include <algorithm>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "cairn/base/error.h"
#include "cairn/base/file.h"
#include "cairn/image/bitmap.h"
#include "image/cv_decode.h"

namespace cairn {
namespace {

// The smallest of the sizes that a JPEG decodes to at once that is not below the wanted one.
int DecodeFlags(const ImageSize& size, int max_side_px) {
  const int factor = std::max(size.width, size.height) / std::max(1, max_side_px);
  const int reduced = factor >= 8   ? cv::IMREAD_REDUCED_COLOR_8
                      : factor >= 4 ? cv::IMREAD_REDUCED_COLOR_4
                      : factor >= 2 ? cv::IMREAD_REDUCED_COLOR_2
                                    : cv::IMREAD_COLOR;
  return reduced | cv::IMREAD_IGNORE_ORIENTATION;
}

}  // namespace

std::string MakeThumbnail(const std::string& path, int max_side_px, int jpeg_quality) {
  const int flags = DecodeFlags(ReadImageSize(path), max_side_px);
  cv::Mat image = DecodeToMat(path, ReadFile(path), flags);
  try {
    const double scale = static_cast<double>(max_side_px) / std::max(image.cols, image.rows);
    if (scale < 1) {
      const cv::Size size(std::max(1, static_cast<int>(image.cols * scale + 0.5)),
                          std::max(1, static_cast<int>(image.rows * scale + 0.5)));
      cv::Mat small;
      cv::resize(image, small, size, 0, 0, cv::INTER_AREA);
      image = small;
    }
    std::vector<uint8_t> jpeg;
    cv::imencode(".jpg", image, jpeg, {cv::IMWRITE_JPEG_QUALITY, jpeg_quality});
    return {jpeg.begin(), jpeg.end()};
  } catch (const cv::Exception& exception) {
    ThrowIfOutOfMemory(exception);
    throw IoError(path, "cannot be decoded: " + exception.err);
  }
}

}  // namespace cairn
