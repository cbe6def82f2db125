#include "image/codecs.h"

#include <algorithm>
#include <cctype>
#include <iterator>
#include <limits>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>

#include "cairn/base/error.h"
#include "image/cv_decode.h"
#include "image/image_container.h"

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

Bitmap CopyImage(const cv::Mat& image) {
  Bitmap bitmap{image.cols, image.rows, image.channels(), {}};
  const size_t row_size = static_cast<size_t>(image.cols) * bitmap.channels;
  bitmap.data.resize(row_size * image.rows);
  for (int y = 0; y < image.rows; ++y) {
    uint8_t* row = bitmap.data.data() + row_size * y;
    if (bitmap.channels == 1) {
      std::copy_n(image.ptr<uint8_t>(y), row_size, row);
    } else {
      SwapRedBlue(image.ptr<uint8_t>(y), row, image.cols);
    }
  }
  return bitmap;
}

// Is it of a format that is read, by the first bytes by which OpenCV's decoder takes a file? OpenCV
// has decoders of more formats, which are not for files of strangers (src/UNTRUSTED_DATA.md).
bool IsOfReadFormat(std::string_view bytes) {
  using namespace std::string_view_literals;
  constexpr std::string_view kSignatures[] = {"\xFF\xD8\xFF"sv, "\x89PNG\r\n\x1A\n"sv, "BM"sv,
                                              "II\x2A\0"sv,     "MM\0\x2A"sv,  // TIFF and BigTIFF
                                              "II\x2B\0"sv,     "MM\0\x2B"sv};
  if (std::any_of(std::begin(kSignatures), std::end(kSignatures),
                  [&](std::string_view signature) { return bytes.starts_with(signature); })) {
    return true;
  }
  if (bytes.starts_with('P')) {
    return bytes.size() > 2 && bytes[1] >= '1' && bytes[1] <= '6' &&
           std::isspace(static_cast<unsigned char>(bytes[2]));
  }
  // A WebP file with a damaged header is offered to the other decoders, and GDCM, which ends the
  // program on damaged files, takes all with this mark at byte 128.
  return bytes.starts_with("RIFF") && bytes.size() >= 12 && bytes.substr(8, 4) == "WEBP" &&
         (bytes.size() < 132 || bytes.substr(128, 4) != "DICM");
}

// A frequent format that is not read, by the first bytes; "": none of them.
std::string_view UnreadFormat(std::string_view bytes) {
  if (bytes.starts_with("GIF8")) return "GIF";
  if (bytes.size() >= 12 && bytes.substr(4, 4) == "ftyp") return "HEIC, AVIF or a video";
  return "";
}

// GDAL, which OpenCV registers among its codecs where they are first used, ends the program where
// memory is missing, and OpenBLAS's threads take what is left until each has its 128 MiB. So that
// much is asked for before. Throws cv::Exception where it is not there.
void PrepareCodecs() {
  [[maybe_unused]] static const bool are_prepared = [] {
    constexpr int kBytes = 192 << 20;
    const cv::Mat room(1, kBytes, CV_8UC1);
    return cv::haveImageWriter(".png");
  }();
}

}  // namespace

cv::Mat DecodeToMat(const std::string& path, std::string_view bytes, int flags) {
  if (!InspectContainer(bytes).is_complete) throw IoError(path, "the image is truncated");
  if (bytes.size() > static_cast<size_t>(std::numeric_limits<int>::max())) {
    throw IoError(path, "the file has more than 2 GiB");
  }
  if (!IsOfReadFormat(bytes)) {
    const std::string_view format = UnreadFormat(bytes);
    throw IoError(path, format.empty() ? "cannot be decoded: not an image, or a damaged one"
                                       : std::string(format) + " is not read");
  }
  const std::string essential = EssentialPngChunks(bytes);
  if (!essential.empty()) bytes = essential;
  // OpenCV wants a mutable pointer but only reads.
  const cv::Mat row(1, static_cast<int>(bytes.size()), CV_8UC1, const_cast<char*>(bytes.data()));
  cv::Mat image;
  try {
    PrepareCodecs();
    image = cv::imdecode(row, flags);
  } catch (const cv::Exception& exception) {
    ThrowIfOutOfMemory(exception);
    throw IoError(path, "cannot be decoded: " + exception.err);
  }
  if (image.empty()) throw IoError(path, "cannot be decoded: a damaged image");
  return image;
}

Bitmap DecodeImage(const std::string& path, std::string_view bytes, BitmapColor color) {
  const int flags = color == BitmapColor::kGray ? cv::IMREAD_GRAYSCALE : cv::IMREAD_COLOR;
  return CopyImage(DecodeToMat(path, bytes, flags | cv::IMREAD_IGNORE_ORIENTATION));
}

std::vector<uint8_t> EncodeImage(const std::string& path, const std::string& extension,
                                 const Bitmap& bitmap, int jpeg_quality) {
  cv::Mat image(bitmap.height, bitmap.width, bitmap.channels == 1 ? CV_8UC1 : CV_8UC3);
  if (bitmap.channels == 1) {
    std::copy(bitmap.data.begin(), bitmap.data.end(), image.ptr<uint8_t>());
  } else {
    SwapRedBlue(bitmap.data.data(), image.ptr<uint8_t>(),
                static_cast<size_t>(bitmap.width) * bitmap.height);
  }
  std::vector<uint8_t> bytes;
  try {
    PrepareCodecs();
    if (cv::imencode(extension, image, bytes, {cv::IMWRITE_JPEG_QUALITY, jpeg_quality})) {
      return bytes;
    }
  } catch (const cv::Exception& exception) {
    ThrowIfOutOfMemory(exception);
    throw IoError(path, "no image format has the extension '" + extension + "'");
  }
  throw IoError(path, "cannot be encoded");
}

}  // namespace cairn
